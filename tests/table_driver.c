/* Runs the self test of press.c with each entry of its tables off by one percent, either way; a zero, by one percent of the table's
   largest. Prints the table and entry of each change that it does not find. Ends with what the self test of the unchanged tables
   gives. TABLES lists them; compile with const defined away. */
#define main self_test
#include "press.c"
#undef main

#include <stdio.h>

static void change(const char *name, real *table)
{
    int k, sign;
    real largest = (real)0;
    for (k = 0; k < NX * NY; k++) {
        largest = largest > (real)fabs((double)table[k]) ? largest : (real)fabs((double)table[k]);
    }
    for (k = 0; k < NX * NY; k++) {
        for (sign = -1; sign <= 1; sign += 2) {
            real before = table[k];
            table[k] += (real)(0.01 * sign) * (before == (real)0 ? largest : before);
            if (self_test() == 0) {
                printf("%s %d of %.9g, largest %.9g\n", name, k, (double)before, (double)largest);
            }
            table[k] = before;
        }
    }
}

#define CHANGE(table) change(#table, &table[0][0]);

int main(void)
{
    TABLES
    return self_test();
}

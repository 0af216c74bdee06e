/* Runs the self test of press.c with each entry of its tables off by one percent, either way; a zero, by
   one percent of the table's largest, and in single precision so is an entry that no sum with the largest
   shows. Prints the table and entry of each change that the test does not find. Ends with what it gives
   for the unchanged tables. TABLES lists them; compile with const defined away. */
#define main self_test
#include "press.c"
#undef main

#include <stdio.h>

static void change(const char *name, real *table)
{
    int k, sign;
    const double seen = sizeof(real) == sizeof(float) ? 5.9604645e-8 : 0.0; /* 2^-24 */
    real largest = (real)0;
    for (k = 0; k < NX * NY; k++) {
        largest = largest > (real)fabs((double)table[k]) ? largest : (real)fabs((double)table[k]);
    }
    for (k = 0; k < NX * NY; k++) {
        for (sign = -1; sign <= 1; sign += 2) {
            real before = table[k];
            const int is_zero = fabs((double)before) <= seen * (double)largest;
            table[k] += (real)(0.01 * sign) * (is_zero ? largest : before);
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

/* Reads operations of two regulators, `first` and `second`, as doubles from stdin; writes the command after each to stdout. */
#include <stdio.h>
#include <string.h>

#include "first.h"
#include "second.h"

typedef first_real real;

int main(void)
{
    first_state first;
    second_state second;
    double row[9], x;
    first_init(&first);
    second_init(&second);
    while (fread(row, sizeof row[0], 9, stdin) == 9) {
        const first_input input = { (real)row[3], (real)row[4], (real)row[5], (real)row[6], (real)row[7], (real)row[8] };
        second_input same;
        const int is_first = row[1] == 0.0;
        memcpy(&same, &input, sizeof same);
        if (row[0] == 1.0) {
            if (is_first) {
                first_reset(&first);
            } else {
                second_reset(&second);
            }
        } else if (row[0] == 2.0) {
            if (is_first) {
                first_start(&first, (real)row[2], &input);
            } else {
                second_start(&second, (real)row[2], &same);
            }
        } else if (is_first) {
            first_step(&first, &input);
        } else {
            second_step(&second, &same);
        }
        x = is_first ? (double)first.x : (double)second.x;
        if (fwrite(&x, sizeof x, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}

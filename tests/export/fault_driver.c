/* Steps the regulator `press` through rows of inputs from stdin; writes, after each, x, the faults so far, whether every state is
   finite, and the command of a regulator that only now begins. Arguments: lowest and highest reference, lowest and highest y. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "press.h"

static int is_finite(const press_state *state)
{
    const press_real *value = &state->x;
    while (value != (const press_real *)&state->lowest && isfinite(*value)) {
        value++;
    }
    return value == (const press_real *)&state->lowest;
}

static void limit(press_state *state, char **given)
{
    state->lowest.reference = (press_real)atof(given[1]);
    state->highest.reference = (press_real)atof(given[2]);
    state->lowest.y = (press_real)atof(given[3]);
    state->highest.y = (press_real)atof(given[4]);
}

int main(int count, char **given)
{
    press_state state, fresh;
    press_input input;
    double row[4];
    press_init(&state);
    while (fread(&input, sizeof input, 1, stdin) == 1) {
        press_init(&fresh);
        if (count == 5) {
            limit(&state, given);
            limit(&fresh, given);
        }
        row[0] = (double)press_step(&state, &input);
        row[1] = (double)state.faults;
        row[2] = is_finite(&state);
        row[3] = (double)press_step(&fresh, &input);
        if (fwrite(row, sizeof row, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}

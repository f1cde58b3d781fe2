/* Run one model through its whole life, to be compiled with the sanitisers on: exact-size memory, a rollback, foreign
 * and truncated states, inputs that are not finite. Arguments: the resources folder or "-", then name=value pairs. */
#include "hsep_fmu.h"
#include "hsep_table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define STEPS 700
#define SAVED_AT 230
#define STEP_SIZE 1e-3 /* s */

static double values[HSEP_N_VALUES], saved_values[HSEP_N_VALUES], end_values[HSEP_N_VALUES];
static char message[HSEP_MESSAGE_SIZE];

static void expect(int held, const char *what)
{
    if (!held) {
        fprintf(stderr, "failed: %s (%s)\n", what, message);
        exit(1);
    }
}

static void set_inputs(double k)
{
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        if (hsep_table_row(&hsep_table, i)->causality == HSEP_INPUT) {
            values[i] = 0.01 * sin(0.01 * k + 0.1 * (double)i);
        }
    }
}

static void run(const hsep_context *context, void *state, int from, int to)
{
    for (int k = from; k < to; k++) {
        set_inputs(k);
        expect(hsep_model_step(context, state, values, k * STEP_SIZE, STEP_SIZE, message) == HSEP_OK, "a step");
    }
}

int main(int n_arguments, char *arguments[])
{
    char variable[HSEP_NAME_SIZE];
    hsep_context context = hsep_table;
    context.resources = n_arguments > 1 && arguments[1][0] != '-' ? arguments[1] : NULL;
    memcpy(values, hsep_starts, sizeof hsep_starts);
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        for (int a = 2; a < n_arguments; a++) {
            const size_t length = strlen(hsep_table_name(&hsep_table, i, variable));
            if (strncmp(arguments[a], variable, length) == 0 && arguments[a][length] == '=') {
                values[i] = strtod(arguments[a] + length + 1, NULL);
            }
        }
    }
    size_t size = 0;
    hsep_model_start_values(&context, values);
    expect(hsep_model_size(&context, values, &size, message) == HSEP_OK, "the size");
    void *state = calloc(1, size);
    char *saved = malloc(size + 1), *end = malloc(size);
    expect(state != NULL && saved != NULL && end != NULL, "memory");
    expect(hsep_model_initialise(&context, state, size, values, 0.0, message) == HSEP_OK, "the initialization");

    /* On to the end, back to the middle, on to the end again: the same bits. */
    run(&context, state, 0, SAVED_AT);
    memcpy(saved + 1, state, size); /* not aligned, as a serialised state may be */
    memcpy(saved_values, values, sizeof values);
    run(&context, state, SAVED_AT, STEPS);
    memcpy(end, state, size);
    memcpy(end_values, values, sizeof values);
    memcpy(state, saved + 1, size);
    memcpy(values, saved_values, sizeof values);
    run(&context, state, SAVED_AT, STEPS);
    expect(memcmp(state, end, size) == 0 && memcmp(values, end_values, sizeof values) == 0, "equal after a rollback");

    /* What must be refused changes nothing. */
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        const hsep_variable *row = hsep_table_row(&hsep_table, i);
        if (row->causality == HSEP_INPUT && row->kind == HSEP_REAL) {
            const double before = values[i];
            values[i] = strcmp(hsep_table_name(&hsep_table, i, variable), "x_meas") == 0 ? HUGE_VAL
                                                                                         : NAN; /* NaN may be missing */
            expect(
                hsep_model_step(&context, state, values, STEPS * STEP_SIZE, STEP_SIZE, message) == HSEP_REFUSED,
                "not finite");
            values[i] = before;
        }
    }
    expect(hsep_model_step(&context, state, values, STEPS * STEP_SIZE, -1.0, message) == HSEP_REFUSED, "h < 0");
    expect(memcmp(state, end, size) == 0 && memcmp(values, end_values, sizeof values) == 0, "equal after refusals");
    free(state);
    free(saved);
    free(end);
    return 0;
}

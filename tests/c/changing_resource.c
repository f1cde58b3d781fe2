/* Ask ReferenceTrajectory for its size, put another file in its resource's place, and initialise it in memory of
 * exactly that size; to be compiled with the address sanitiser. Arguments: the resources folder with a trailing slash,
 * the file in it, and what takes its place. Prints the message of a refusal, or the last position that is played. */
#include "hsep_fmu.h"
#include "hsep_table.h"

#include <stdio.h>
#include <stdlib.h>

#define STEP_SIZE 1e-3 /* s */
#define STEPS 5000     /* longer than any file of the test */

int main(int n_arguments, char *arguments[])
{
    static double values[HSEP_N_VARIABLES];
    char message[HSEP_MESSAGE_SIZE] = "";
    size_t size = 0;
    if (n_arguments != 4) {
        return 2;
    }
    hsep_context context = hsep_table;
    context.resources = arguments[1];
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        values[i] = hsep_table_start(&hsep_table, i);
    }
    if (hsep_model_size(&context, values, &size, message) != HSEP_OK || rename(arguments[3], arguments[2]) != 0) {
        fprintf(stderr, "no beginning: %s\n", message);
        return 2;
    }
    void *state = calloc(1, size);
    if (state == NULL) {
        return 2;
    }
    if (hsep_model_initialise(&context, state, size, values, 0.0, message) != HSEP_OK) {
        puts(message);
    } else {
        for (int k = 0; k < STEPS; k++) {
            if (hsep_model_step(&context, state, values, k * STEP_SIZE, STEP_SIZE, message) != HSEP_OK) {
                return 2;
            }
        }
        printf("%g\n", values[HSEP_VR_r]);
    }
    free(state);
    return 0;
}

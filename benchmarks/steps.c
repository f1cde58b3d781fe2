/* Steps of a model, whose instructions are counted: of HybridPredictor fed with a log, or of SepCompensator in closed
 * loop with the drive of eq. (13).
 *
 * Usage: steps STEPS LOG name=value ...
 *   LOG    x_d, then x, doubles, m, as many of each; played over and over; in closed loop x_d alone is used
 *   weights=FILE what was learned before: a warm run
 */
#include "hsep_fmu.h"
#include "hsep_table.h"
#include "hsep_plant.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void fail(const char *what)
{
    fprintf(stderr, "steps: %s\n", what);
    exit(2);
}

/* The content of a file, to be freed. */
static void *content_of(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    void *content = NULL;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        *size = (size_t)ftell(file);
        content = malloc(*size + 1);
        rewind(file);
    }
    if (content == NULL || fread(content, 1, *size, file) != *size) {
        fail("a file cannot be read");
    }
    fclose(file);
    return content;
}

/* The measured position at sample k, m. */
typedef struct {
    const double *x; /* (n_log,) m, of the log, delayed by the look-ahead */
    size_t n_log, delay;
    hsep_feed_drive drive; /* in closed loop */
    hsep_encoder encoder;
} position_source;

static double measured(position_source *source, const double values[], size_t k)
{
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    const double x_meas = hsep_encoder_measure(&source->encoder, hsep_feed_drive_x(&source->drive));
    double reached = 0.0;
    (void)k;
    if (!hsep_feed_drive_step(&source->drive, values[HSEP_VR_x_dm], values[HSEP_VR_T_s], &reached)) {
        fail("the drive's state overflowed");
    }
    return x_meas;
#else
    (void)values;
    return source->x[k < source->delay ? 0 : (k - source->delay) % source->n_log];
#endif
}

int main(int n_arguments, char *arguments[])
{
    static double values[HSEP_N_VALUES];
    char message[HSEP_MESSAGE_SIZE] = "";
    char variable[HSEP_NAME_SIZE];
    hsep_context context = hsep_table;
    if (n_arguments < 3) {
        fail("usage: steps STEPS LOG name=value ...");
    }
    const size_t steps = strtoul(arguments[1], NULL, 10);
    for (int a = 3; a < n_arguments; a++) {
        if (strncmp(arguments[a], "weights=", strlen("weights=")) == 0) {
            context.weights = content_of(arguments[a] + strlen("weights="), &context.weights_size);
        }
    }
    memcpy(values, hsep_starts, sizeof hsep_starts);
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        const size_t length = strlen(hsep_table_name(&hsep_table, i, variable));
        for (int a = 3; a < n_arguments; a++) {
            if (strncmp(arguments[a], variable, length) == 0 && arguments[a][length] == '=') {
                values[i] = strtod(arguments[a] + length + 1, NULL);
            }
        }
    }

    size_t size = 0;
    double *x_d = content_of(arguments[2], &size);
    const size_t n_log = size / (2 * sizeof *x_d);
    const double *x = x_d + n_log;
    if (n_log == 0) {
        fail("the log has no samples");
    }
    if (hsep_model_size(&context, values, &size, message) != HSEP_OK) {
        fail(message);
    }
    void *state = calloc(1, size);
    if (state == NULL) {
        fail("out of memory");
    }
    values[HSEP_VR_x_d_ahead] = x_d[0];
    if (hsep_model_initialise(&context, state, size, values, 0.0, message) != HSEP_OK) {
        fail(message);
    }
    const double T_s = values[HSEP_VR_T_s];
    position_source source = {.x = x, .n_log = n_log, .delay = (size_t)values[HSEP_VR_Np]};
    source.drive = (hsep_feed_drive){.m = 1.0, .c = 15.7, .k = 24674.0, .c_nl = 100.0, .k_nl = 1000.0};
    hsep_feed_drive_reset(&source.drive, x_d[0]);
    hsep_encoder_init(&source.encoder, 5e-6, 0);
    for (size_t k = 0; k < steps; k++) {
        values[HSEP_VR_x_d_ahead] = x_d[k % n_log];
        values[HSEP_VR_x_meas] = measured(&source, values, k);
        if (hsep_model_step(&context, state, values, (double)k * T_s, T_s, message) != HSEP_OK) {
            fail(message);
        }
    }
    free(state);
    free(x_d);
    return 0;
}

/* How long one step of a model takes, step by step, beside a loop of the same length that does nothing: of
 * HybridPredictor fed with a log, or of SepCompensator in closed loop with the drive of eq. (13).
 *
 * Usage: step_time STEPS LOG TIMES name=value ...
 *   LOG    x_d, then x, doubles, m, as many of each; played over and over; in closed loop x_d alone is used
 *   weights=FILE what was learned before: a warm run
 *   TIMES  written: STEPS doubles, ns, the steps; then STEPS doubles, ns, the empty loop; "-" for none
 * Prints one line of JSON. Pinned to the processor it starts on where the system allows it.
 */
#if defined(__linux__)
#define _GNU_SOURCE
#include <sched.h>
#else
#define _POSIX_C_SOURCE 200809L
#endif

#include "hsep_fmu.h"
#include "hsep_table.h"
#include "hsep_plant.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static int pin(void)
{
#if defined(__linux__)
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)sched_getcpu(), &set);
    return sched_setaffinity(0, sizeof set, &set) == 0;
#else
    return 0;
#endif
}

static void fail(const char *what)
{
    fprintf(stderr, "step_time: %s\n", what);
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

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double *sorted(const double times[], size_t n)
{
    double *copy = malloc(n * sizeof *copy);
    if (copy == NULL) {
        fail("out of memory");
    }
    memcpy(copy, times, n * sizeof *copy);
    qsort(copy, n, sizeof *copy, by_size);
    return copy;
}

static void print_summary(const char *name, const double times[], size_t n)
{
    double *s = sorted(times, n);
    printf(
        "\"%s\": {\"median\": %.1f, \"p99\": %.1f, \"p99.9\": %.1f, \"max\": %.1f}", name, s[n / 2], s[n - 1 - n / 100],
        s[n - 1 - n / 1000], s[n - 1]);
    free(s);
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

/* Count to n; the compiler cannot know that this does nothing. */
static void idle(size_t n)
{
    for (volatile size_t i = 0; i < n; i++) {}
}

int main(int n_arguments, char *arguments[])
{
    static double values[HSEP_N_VALUES];
    char message[HSEP_MESSAGE_SIZE] = "";
    char variable[HSEP_NAME_SIZE];
    hsep_context context = hsep_table;
    if (n_arguments < 4) {
        fail("usage: step_time STEPS LOG TIMES name=value ...");
    }
    const size_t steps = strtoul(arguments[1], NULL, 10);
    for (int a = 4; a < n_arguments; a++) {
        if (strncmp(arguments[a], "weights=", strlen("weights=")) == 0) {
            context.weights = content_of(arguments[a] + strlen("weights="), &context.weights_size);
        }
    }
    memcpy(values, hsep_starts, sizeof hsep_starts);
    for (size_t i = 0; i < HSEP_N_VARIABLES; i++) {
        const size_t length = strlen(hsep_table_name(&hsep_table, i, variable));
        for (int a = 4; a < n_arguments; a++) {
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
    double *times = malloc(2 * steps * sizeof *times), *empty = times + steps;
    if (steps == 0 || state == NULL || times == NULL) {
        fail("out of memory, or no steps");
    }
    values[HSEP_VR_x_d_ahead] = x_d[0];
    if (hsep_model_initialise(&context, state, size, values, 0.0, message) != HSEP_OK) {
        fail(message);
    }
    memset(times, 1, 2 * steps * sizeof *times); /* every page is there before the first step */
    const int pinned = pin();
    const double T_s = values[HSEP_VR_T_s];
    position_source source = {.x = x, .n_log = n_log, .delay = (size_t)values[HSEP_VR_Np]};
    source.drive = (hsep_feed_drive){.m = 1.0, .c = 15.7, .k = 24674.0, .c_nl = 100.0, .k_nl = 1000.0};
    hsep_feed_drive_reset(&source.drive, x_d[0]);
    hsep_encoder_init(&source.encoder, 5e-6, 0);
    for (size_t k = 0; k < steps; k++) {
        values[HSEP_VR_x_d_ahead] = x_d[k % n_log];
        values[HSEP_VR_x_meas] = measured(&source, values, k);
        const double t = (double)k * T_s, before = now_ns();
        const hsep_status status = hsep_model_step(&context, state, values, t, T_s, message);
        times[k] = now_ns() - before;
        if (status != HSEP_OK) {
            fail(message);
        }
    }

    /* The same loop around nothing, made as long as the median step. */
    double *order = sorted(times, steps);
    const double median = order[steps / 2];
    free(order);
    size_t count = 1;
    for (double took = 0.0; took < median && count < SIZE_MAX / 2;) {
        count += count / 16 + 1;
        took = 1e300;
        for (int i = 0; i < 50; i++) {
            const double before = now_ns();
            idle(count);
            const double once = now_ns() - before;
            took = once < took ? once : took;
        }
    }
    for (size_t k = 0; k < steps; k++) {
        const double before = now_ns();
        idle(count);
        empty[k] = now_ns() - before;
    }

    printf("{\"steps\": %lu, \"pinned\": %s, ", (unsigned long)steps, pinned ? "true" : "false");
    printf("\"state_bytes\": %lu, ", (unsigned long)size);
#if defined(HSEP_MODEL_SEP_COMPENSATOR)
    printf("\"rms_e\": %.3e, ", values[HSEP_VR_rms_e]);
#endif
    print_summary("step", times, steps);
    printf(", ");
    print_summary("empty", empty, steps);
    printf("}\n");
    if (strcmp(arguments[3], "-") != 0) {
        FILE *file = fopen(arguments[3], "wb");
        if (file == NULL || fwrite(times, sizeof *times, 2 * steps, file) != 2 * steps || fclose(file) != 0) {
            fail("the times cannot be written");
        }
    }
    free(times);
    free(state);
    free(x_d);
    return 0;
}

/* Replay of a recorded axis: predict every window of a CSV before it is learned, print the errors.
 *
 *     replay LOG.csv NP F_N ZETA
 *     replay LOG.csv                 compiled with -include my_axis.h -DAXIS=my_axis
 *
 * LOG.csv: rows of time, commanded and measured position, m, or [mm] or [um] as a header says, one each sampling
 * interval, as hybridsep example-log writes it. NP: samples of a window; F_N, Hz, and ZETA: the drive's linear model,
 * one mode with unit gain. my_axis.h: an axis that hybridsep fit has identified, by hybridsep header --predictor, with
 * what it has learned if it has --weights.
 */
#include "hsep.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 4096

/* Read the log, x_d and x by turns, (n, 2), m; return it, to be freed, or NULL. */
static double *read_log(const char *path, size_t *n)
{
    char line[LINE_SIZE];
    double *log = NULL, scale = 1.0; /* m in the unit of the header */
    size_t room = 0;
    FILE *file = fopen(path, "r");
    *n = 0;
    if (file == NULL) {
        perror(path);
        return NULL;
    }
    while (fgets(line, LINE_SIZE, file) != NULL) {
        double t, x_d, x;
        if (sscanf(line, "%lf,%lf,%lf", &t, &x_d, &x) < 3) {
            scale = strstr(line, "[mm]") != NULL ? 1e-3 : strstr(line, "[um]") != NULL ? 1e-6 : scale;
            continue;
        }
        if (*n == room) {
            double *larger = realloc(log, 2 * (room = 2 * room + 1024) * sizeof *log);
            if (larger == NULL) {
                break;
            }
            log = larger;
        }
        log[2 * *n] = scale * x_d;
        log[2 * (*n)++ + 1] = scale * x;
    }
    fclose(file);
    return log;
}

/* Predict the log: in each sample the command that comes Np samples later, and what is measured now. */
static int replay(hsep_predictor *predictor, size_t Np, const double *log, size_t n)
{
    hsep_predictor_outputs outputs;
    for (size_t k = 0; k < n + Np; k++) {
        const double x_d_ahead = log[2 * (k < n ? k : n - 1)]; /* after the end the command stays */
        const double x_meas = k < Np ? log[0] : log[2 * (k - Np) + 1];
        (void)hsep_predictor_sample(predictor, x_d_ahead, x_meas);
        hsep_predictor_read(predictor, &outputs);
        if (outputs.divergence != HSEP_CONVERGES) {
            fprintf(stderr, "the prediction diverges at sample %lu\n", (unsigned long)k);
            return 0;
        }
    }
    printf(
        "rms of the error, um: physics %.3f, hold %.3f, hybrid %.3f; %lu measurements not believed\n",
        1e6 * outputs.rms_pb, 1e6 * outputs.rms_hold, 1e6 * outputs.rms_h, (unsigned long)outputs.n_rejected);
    return 1;
}

#ifdef AXIS
#define JOINED(name, part) name##part
#define OF_AXIS(name, part) JOINED(name, part)
#define USAGE "LOG.csv"
#else
#define USAGE "LOG.csv NP F_N ZETA"

/* Take NP, F_N and ZETA; return whether they are numbers. */
static int take_parameters(hsep_parameters *parameters, hsep_mode *mode, char *arguments[])
{
    double numbers[3];
    for (int i = 0; i < 3; i++) {
        char *end;
        numbers[i] = strtod(arguments[i], &end);
        if (end == arguments[i] || *end != '\0' || !(numbers[i] >= 0.0 && numbers[i] <= 1e9)) {
            fprintf(stderr, "NP, F_N and ZETA must be numbers, got %s\n", arguments[i]);
            return 0;
        }
    }
    const double omega = 2.0 * 3.14159265358979323846 * numbers[1];
    *mode = (hsep_mode){.f_n = numbers[1], .zeta = numbers[2], .alpha = omega * omega};
    hsep_defaults(parameters);
    parameters->predictor.Np = (hsep_int)numbers[0];
    parameters->predictor.p = parameters->predictor.Np < 50 ? parameters->predictor.Np : 50;
    parameters->n_modes = 1;
    parameters->modes = mode;
    return 1;
}
#endif

int main(int argc, char *argv[])
{
    size_t n = 0;
    hsep_parameters parameters;
#ifdef AXIS
    const void *const weights = OF_AXIS(AXIS, _weights);
    const size_t weights_size = OF_AXIS(AXIS, _weights_size);
    const int taken = argc == 2;
    OF_AXIS(AXIS, _parameters)(&parameters);
#else
    const void *const weights = NULL;
    const size_t weights_size = 0;
    hsep_mode mode;
    const int taken = argc == 5 && take_parameters(&parameters, &mode, argv + 2);
#endif
    if (!taken) {
        fprintf(stderr, "usage: %s " USAGE "\n", argv[0]);
        return 2;
    }
    const size_t size = hsep_predictor_size(&parameters);
    if (size == 0) {
        const char *refused = hsep_predictor_refused(&parameters);
        fprintf(
            stderr, "%s is out of its range (hsep_settings.h)\n", refused == NULL ? "the size of the block" : refused);
        return 2;
    }
    double *log = read_log(argv[1], &n);
    hsep_predictor *predictor = malloc(size);
    int done = n > 0 && predictor != NULL;
    if (done) {
        const hsep_began began = hsep_predictor_init(predictor, &parameters, log[0], weights, weights_size);
        if (began != HSEP_BEGAN) {
            fprintf(
                stderr, "cold: the weights are %s\n", began == HSEP_WEIGHTS_OTHER ? "of other settings" : "damaged");
        }
        done = replay(predictor, (size_t)parameters.predictor.Np, log, n);
    } else {
        fprintf(stderr, "%s\n", n == 0 ? "the log must have rows of t,x_d,x" : "no memory");
    }
    free(predictor);
    free(log);
    return done ? 0 : 1;
}

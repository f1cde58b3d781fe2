/* Replay of a recorded axis: predict every window of a CSV before it is learned, print the errors.
 *
 *     replay LOG.csv NP F_N ZETA [WEIGHTS.bin]
 *
 * LOG.csv: a header with the columns x_d and x_meas (commanded and measured position, m, or [mm] or [um] as it says),
 * a row each 1 ms, as hybridsep example-log writes it. F_N, Hz, and ZETA: the drive's linear model, one mode with unit
 * gain. WEIGHTS.bin: what an earlier run has learned (hybridsep hal --weights).
 */
#include "hsep.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 4096

/* A column of the log. */
typedef struct {
    int place;    /* -1: there is none */
    double scale; /* m in its unit */
} column;

/* Take a column if a name in the header is its, alone or with its unit: x_d [mm]. */
static void take_column(column *self, const char *name, const char *own, int place)
{
    const size_t length = strlen(own);
    if (strncmp(name, own, length) == 0 && (name[length] == '\0' || name[length] == ' ')) {
        self->place = place;
        self->scale = strstr(name, "[mm]") != NULL ? 1e-3 : strstr(name, "[um]") != NULL ? 1e-6 : 1.0;
    }
}

/* Find x_d and x_meas in the header; return whether both are there. */
static int find_columns(char line[], column *x_d, column *x)
{
    int place = 0;
    x_d->place = x->place = -1;
    for (char *name = strtok(line, ",\r\n"); name != NULL; name = strtok(NULL, ",\r\n"), place++) {
        take_column(x_d, name, "x_d", place);
        take_column(x, name, "x_meas", place);
    }
    return x_d->place >= 0 && x->place >= 0;
}

/* The number in a column, m; return whether there is one. */
static int read_number(const char *line, column from, double *number)
{
    char *end;
    for (int i = 0; i < from.place; i++) {
        line = strchr(line, ',');
        if (line == NULL) {
            return 0;
        }
        line++;
    }
    *number = from.scale * strtod(line, &end);
    return end != line;
}

/* Read the next line that is no comment; return whether there is one. */
static int read_line(FILE *file, char line[LINE_SIZE])
{
    do {
        if (fgets(line, LINE_SIZE, file) == NULL) {
            return 0;
        }
    } while (line[0] == '#');
    return 1;
}

/* Read the log, x_d and x_meas by turns, (n, 2), m; return it, to be freed, or NULL. */
static double *read_log(const char *path, size_t *n)
{
    char line[LINE_SIZE];
    column x_d = {0}, x = {0};
    double *log = NULL;
    size_t room = 0;
    FILE *file = fopen(path, "r");
    *n = 0;
    if (file == NULL || !read_line(file, line) || !find_columns(line, &x_d, &x)) {
        fprintf(stderr, "%s must be a CSV with the columns x_d and x_meas\n", path);
        if (file != NULL) {
            fclose(file);
        }
        return NULL;
    }
    while (read_line(file, line)) {
        if (*n == room) {
            double *larger = realloc(log, 2 * (room = 2 * room + 1024) * sizeof *log);
            if (larger == NULL) {
                break;
            }
            log = larger;
        }
        if (read_number(line, x_d, &log[2 * *n]) && read_number(line, x, &log[2 * *n + 1])) {
            ++*n;
        }
    }
    fclose(file);
    return log;
}

/* Read a whole file; return its bytes, to be freed, or NULL. */
static void *read_bytes(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    void *bytes = NULL;
    *size = 0;
    if (file != NULL && fseek(file, 0, SEEK_END) == 0) {
        const long end = ftell(file);
        if (end > 0 && fseek(file, 0, SEEK_SET) == 0 && (bytes = malloc((size_t)end)) != NULL) {
            *size = fread(bytes, 1, (size_t)end, file);
        }
    }
    if (file != NULL) {
        fclose(file);
    }
    return bytes;
}

/* Predict the log: in each sample the command that comes Np samples later, and what is measured now. */
static int replay(hsep_predictor *predictor, size_t Np, const double *log, size_t n)
{
    hsep_predictor_outputs outputs;
    for (size_t k = 0; k < n + Np; k++) {
        const double x_d_ahead = log[2 * (k < n ? k : n - 1)]; /* behind the end the command stays */
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

int main(int argc, char *argv[])
{
    const double pi = 3.14159265358979323846;
    size_t n = 0, weights_size = 0;
    hsep_parameters parameters;
    if (argc < 5) {
        fprintf(stderr, "usage: %s LOG.csv NP F_N ZETA [WEIGHTS.bin]\n", argv[0]);
        return 2;
    }
    const double omega = 2.0 * pi * atof(argv[3]);
    const hsep_mode mode = {.f_n = atof(argv[3]), .zeta = atof(argv[4]), .alpha = omega * omega};
    hsep_defaults(&parameters);
    parameters.predictor.Np = strtoul(argv[2], NULL, 10);
    parameters.predictor.p = parameters.predictor.Np < 50 ? parameters.predictor.Np : 50;
    parameters.n_modes = 1;
    parameters.modes = &mode;
    const size_t size = hsep_predictor_size(&parameters);
    if (size == 0) {
        fprintf(stderr, "NP, F_N or ZETA is out of its range (hsep_ranges.h)\n");
        return 2;
    }
    double *log = read_log(argv[1], &n);
    void *weights = argc > 5 ? read_bytes(argv[5], &weights_size) : NULL;
    hsep_predictor *predictor = malloc(size);
    int done = log != NULL && n > 0 && predictor != NULL && (argc < 6 || weights != NULL);
    if (done) {
        const hsep_began began = hsep_predictor_init(predictor, &parameters, log[0], weights, weights_size);
        if (began != HSEP_BEGAN) {
            fprintf(
                stderr, "cold: the weights are %s\n", began == HSEP_WEIGHTS_OTHER ? "of other settings" : "damaged");
        }
        done = replay(predictor, (size_t)parameters.predictor.Np, log, n);
    }
    free(predictor);
    free(weights);
    free(log);
    return done ? 0 : 1;
}

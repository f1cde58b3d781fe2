/* Drive the C core for long, and count every call of the allocator in this process.
 *
 *   fold ROWS N_ROWS N LAMBDA REPETITIONS WEIGHTS   fold rows [phi | target], (N_ROWS, N + 1), over and over into the
 *                                                   regression and write the N weights
 *   step SAMPLES TRUST                              step the FMU, through its FMI functions, along a made-up motion
 *
 * Prints counts of allocator calls: up to the end of the initialization, and from there on to the end of the work; and
 * of the steps the RMS error of x_h, m, in the second twentieth of the samples and in the last one.
 */
#include "hsep_fmu.h"
#include "hsep_regression.h"

#include "fmi2Functions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The C library's own allocator, under the names that remain when a program brings functions of the usual names. */
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *block);

static unsigned long allocator_calls;

void *malloc(size_t size)
{
    allocator_calls++;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    allocator_calls++;
    return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    allocator_calls++;
    return __libc_realloc(block, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    allocator_calls++;
    return __libc_memalign(alignment, size);
}

void free(void *block)
{
    allocator_calls++;
    __libc_free(block);
}

static void expect(int held, const char *what)
{
    if (!held) {
        fprintf(stderr, "failed: %s\n", what);
        exit(2);
    }
}

static void report(unsigned long before, double early, double late)
{
    const unsigned long after = allocator_calls - before;
    printf("{\"before\": %lu, \"after\": %lu, \"early\": %.17g, \"late\": %.17g}\n", before, after, early, late);
}

static void fold(char *arguments[])
{
    const size_t n_rows = strtoul(arguments[1], NULL, 10), n = strtoul(arguments[2], NULL, 10), width = n + 1;
    const unsigned long repetitions = strtoul(arguments[4], NULL, 10);
    double *rows = malloc(n_rows * width * sizeof *rows), *w = malloc(n * sizeof *w);
    hsep_regression *regression = malloc((size_t)hsep_regression_size(n));
    expect(rows != NULL && w != NULL && regression != NULL, "memory");
    FILE *file = fopen(arguments[0], "rb");
    expect(file != NULL && fread(rows, sizeof *rows, n_rows * width, file) == n_rows * width, "the rows");
    fclose(file);
    hsep_regression_init(regression, n, strtod(arguments[3], NULL));
    const unsigned long before = allocator_calls;
    for (unsigned long i = 0; i < repetitions; i++) {
        for (size_t k = 0; k < n_rows; k++) {
            memcpy(hsep_regression_row(regression), rows + k * width, width * sizeof *rows);
            hsep_regression_fold(regression);
        }
    }
    hsep_regression_solve(regression, w);
    report(before, 0.0, 0.0);
    file = fopen(arguments[5], "wb");
    expect(file != NULL && fwrite(w, sizeof *w, n, file) == n && fclose(file) == 0, "writing the weights");
    free(regression);
    free(w);
    free(rows);
}

/* A motion that repeats, in samples, so that its last round is as its first but for the noise. */
#define ROUND 10000

static double command[ROUND], position[ROUND];

static void move(void)
{
    const double turn = 6.283185307179586 / ROUND;
    for (int k = 0; k < ROUND; k++) {
        command[k] = 0.01 * (1.0 - cos(4.0 * turn * k)) + 0.002 * sin(28.0 * turn * k);
    }
    for (int k = 0; k < ROUND; k++) {
        const double late = command[(k + ROUND - 2) % ROUND], v = late - command[(k + ROUND - 3) % ROUND];
        position[k] = 0.999 * late - 2e-5 * tanh(v / 1e-6) + 5e-6 * sin(480.0 * turn * k);
    }
}

/* White noise, uniform within +- 1 um: the 64-bit generator of Knuth's MMIX. */
static double noise(void)
{
    static unsigned long long state = 1;
    state = 6364136223846793005ULL * state + 1442695040888963407ULL;
    return 1e-6 * ((double)(state >> 11) / 4503599627370496.0 - 1.0);
}

static void step(unsigned long samples, int trust)
{
    const fmi2ValueReference inputs[2] = {HSEP_VR_x_d_ahead, HSEP_VR_x_meas}, output = HSEP_VR_x_h;
    const fmi2ValueReference trusted = HSEP_VR_trust;
    const double T_s = hsep_starts[HSEP_VR_T_s];
    double x_h = 0.0, early = 0.0, late = 0.0;
    const unsigned long part = samples / 20, Np = (unsigned long)hsep_starts[HSEP_VR_Np];
    move();
    fmi2Component fmu = fmi2Instantiate("long run", fmi2CoSimulation, HSEP_GUID, NULL, NULL, fmi2False, fmi2False);
    expect(fmu != NULL && fmi2SetBoolean(fmu, &trusted, 1, &(fmi2Boolean){trust}) == fmi2OK, "the instance");
    expect(fmi2SetReal(fmu, inputs, 1, command) == fmi2OK, "the command at the start");
    expect(fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "the experiment");
    expect(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK, "initialization");
    const unsigned long before = allocator_calls;
    for (unsigned long k = 0; k < samples; k++) { /* the drive begins when its first command has arrived */
        const double x = k < Np ? command[0] : position[(k - Np) % ROUND];
        const double values[2] = {command[k % ROUND], x + noise()}, e = x_h - x;
        early += k >= part && k < 2 * part ? e * e : 0.0;
        late += k >= 19 * part && k < 20 * part ? e * e : 0.0;
        expect(fmi2SetReal(fmu, inputs, 2, values) == fmi2OK, "setting the inputs");
        expect(fmi2DoStep(fmu, (double)k * T_s, T_s, fmi2True) == fmi2OK, "a step");
        expect(fmi2GetReal(fmu, &output, 1, &x_h) == fmi2OK && isfinite(x_h), "reading the output");
    }
    report(before, sqrt(early / (double)part), sqrt(late / (double)part));
    fmi2FreeInstance(fmu);
}

int main(int n_arguments, char *arguments[])
{
    if (n_arguments == 8 && strcmp(arguments[1], "fold") == 0) {
        fold(arguments + 2);
    } else if (n_arguments == 4 && strcmp(arguments[1], "step") == 0) {
        step(strtoul(arguments[2], NULL, 10), atoi(arguments[3]));
    } else {
        fprintf(stderr, "usage: fold ROWS N_ROWS N LAMBDA REPETITIONS WEIGHTS | step SAMPLES TRUST\n");
        return 2;
    }
    return 0;
}

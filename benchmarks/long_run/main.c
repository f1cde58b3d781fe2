/* Drive the C core for long, and count every call of the allocator in this process.
 *
 *   fold ROWS N_ROWS N LAMBDA REPETITIONS WEIGHTS   fold rows [phi | target], (N_ROWS, N + 1), over and over into the
 *                                                   regression and write the N weights
 *   step SAMPLES                                    step the FMU, through its FMI functions, along a made-up motion
 *
 * Prints two counts of allocator calls: up to the end of the initialization, and from there on to the end of the work.
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

static void report(unsigned long before)
{
    const unsigned long after = allocator_calls - before;
    printf("{\"before\": %lu, \"after\": %lu}\n", before, after);
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
    report(before);
    file = fopen(arguments[5], "wb");
    expect(file != NULL && fwrite(w, sizeof *w, n, file) == n && fclose(file) == 0, "writing the weights");
    free(regression);
    free(w);
    free(rows);
}

static void step(unsigned long samples)
{
    const fmi2ValueReference inputs[2] = {HSEP_VR_x_d_ahead, HSEP_VR_x_meas}, output = HSEP_VR_x_h;
    const double T_s = hsep_starts[HSEP_VR_T_s];
    double x_h = 0.0;
    fmi2Component fmu = fmi2Instantiate("long run", fmi2CoSimulation, HSEP_GUID, NULL, NULL, fmi2False, fmi2False);
    expect(fmu != NULL && fmi2SetupExperiment(fmu, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "the instance");
    expect(fmi2EnterInitializationMode(fmu) == fmi2OK && fmi2ExitInitializationMode(fmu) == fmi2OK, "initialization");
    const unsigned long before = allocator_calls;
    for (unsigned long k = 0; k < samples; k++) {
        const double x_d = 0.01 * sin(2e-3 * (double)k);
        const double values[2] = {x_d, 0.99 * x_d + 1e-5 * sin(0.3 * (double)k)};
        expect(fmi2SetReal(fmu, inputs, 2, values) == fmi2OK, "setting the inputs");
        expect(fmi2DoStep(fmu, (double)k * T_s, T_s, fmi2True) == fmi2OK, "a step");
        expect(fmi2GetReal(fmu, &output, 1, &x_h) == fmi2OK && isfinite(x_h), "reading the output");
    }
    report(before);
    fmi2FreeInstance(fmu);
}

int main(int n_arguments, char *arguments[])
{
    if (n_arguments == 8 && strcmp(arguments[1], "fold") == 0) {
        fold(arguments + 2);
    } else if (n_arguments == 3 && strcmp(arguments[1], "step") == 0) {
        step(strtoul(arguments[2], NULL, 10));
    } else {
        fprintf(stderr, "usage: fold ROWS N_ROWS N LAMBDA REPETITIONS WEIGHTS | step SAMPLES\n");
        return 2;
    }
    return 0;
}

/* Play signals through one FMI 2.0 co-simulation FMU and print its outputs bit by bit, on any platform.
 *
 * host LIBRARY GUID RESOURCES STEP N_INPUTS REFERENCE... SIGNALS
 *
 * SIGNALS holds one double (little-endian) for each of the N_INPUTS first REFERENCEs a sample; they are set before
 * the step, the other REFERENCEs are printed after it as hexadecimal floats, a line a sample. Without inputs, SIGNALS
 * holds a single double a sample, which nobody reads. The first sample is what the initialization starts from.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) LoadLibraryA(path)
#define FIND(library, name) GetProcAddress(library, name)
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

#define MAX_REFERENCES 32

static void expect(int held, const char *what, const char *which)
{
    if (!held) {
        fprintf(stderr, "host: %s %s\n", what, which);
        exit(1);
    }
}

/* A function of the library under its name; object and function pointers are of one size here. */
#define FUNCTION(name) \
    name##TYPE *call_##name; \
    { \
        const void *address = (const void *)FIND(library, #name); \
        expect(address != NULL, "cannot find", #name); \
        memcpy(&call_##name, &address, sizeof address); \
    }

#define CHECK(name, ...) expect(call_##name(__VA_ARGS__) == fmi2OK, "not OK:", #name)

static void print_message(
    fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
    fmi2String message, ...)
{
    (void)environment;
    va_list arguments;
    va_start(arguments, message);
    fprintf(stderr, "%s, status %d, %s: ", instance, (int)status, category);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

int main(int argc, char *argv[])
{
    expect(
        argc > 7 && argc - 7 <= MAX_REFERENCES, "expected",
        "LIBRARY GUID RESOURCES STEP N_INPUTS REFERENCE... SIGNALS");
    const double h = atof(argv[4]);
    const size_t n_inputs = strtoul(argv[5], NULL, 10), n = (size_t)argc - 7;
    fmi2ValueReference references[MAX_REFERENCES];
    for (size_t i = 0; i < n; i++) {
        references[i] = (fmi2ValueReference)strtoul(argv[6 + i], NULL, 10);
    }
    void *library = (void *)OPEN(argv[1]);
    expect(library != NULL, "cannot load", argv[1]);
    FUNCTION(fmi2Instantiate)
    FUNCTION(fmi2EnterInitializationMode)
    FUNCTION(fmi2ExitInitializationMode)
    FUNCTION(fmi2SetReal)
    FUNCTION(fmi2GetReal)
    FUNCTION(fmi2DoStep)

    const fmi2CallbackFunctions callbacks = {print_message, calloc, free, NULL, NULL};
    fmi2Component fmu =
        call_fmi2Instantiate("host", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
    FILE *signals = fopen(argv[argc - 1], "rb");
    expect(fmu != NULL && signals != NULL && n_inputs <= n, "cannot begin with", argv[1]);
    const size_t width = n_inputs > 0 ? n_inputs : 1;
    double row[MAX_REFERENCES], outputs[MAX_REFERENCES];
    for (unsigned long k = 0; fread(row, sizeof row[0], width, signals) == width; k++) {
        if (k == 0) {
            CHECK(fmi2EnterInitializationMode, fmu);
            CHECK(fmi2SetReal, fmu, references, n_inputs, row);
            CHECK(fmi2ExitInitializationMode, fmu);
        }
        CHECK(fmi2SetReal, fmu, references, n_inputs, row);
        CHECK(fmi2DoStep, fmu, (double)k * h, h, fmi2True);
        CHECK(fmi2GetReal, fmu, references + n_inputs, n - n_inputs, outputs);
        for (size_t i = 0; i < n - n_inputs; i++) {
            printf("%a%c", outputs[i], i + 1 < n - n_inputs ? ' ' : '\n');
        }
    }
    return 0;
}

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
#else
#include <dlfcn.h>
#endif

#define MAX_REFERENCES 16

static void fail(const char *what, const char *which)
{
    fprintf(stderr, "host: %s %s\n", what, which);
    exit(1);
}

static void *open_library(const char *path)
{
#ifdef _WIN32
    void *library = LoadLibraryA(path);
#else
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
#endif
    if (library == NULL) {
        fail("cannot load", path);
    }
    return library;
}

/* Put a function's address where a pointer to it is; object and function pointers are of one size here. */
static void find(void *library, const char *name, void *pointer)
{
#ifdef _WIN32
    const FARPROC address = GetProcAddress(library, name);
#else
    const void *address = dlsym(library, name);
#endif
    if (address == NULL) {
        fail("cannot find", name);
    }
    memcpy(pointer, &address, sizeof address);
}

static void check(fmi2Status status, const char *call)
{
    if (status != fmi2OK) {
        fail("not OK:", call);
    }
}

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
    if (argc < 8 || argc - 7 > MAX_REFERENCES) {
        fail("expected", "LIBRARY GUID RESOURCES STEP N_INPUTS REFERENCE... SIGNALS");
    }
    const double h = atof(argv[4]);
    const size_t n_inputs = strtoul(argv[5], NULL, 10), n_references = (size_t)argc - 7;
    if (n_inputs > n_references) {
        fail("too few references for", argv[5]);
    }
    fmi2ValueReference references[MAX_REFERENCES];
    for (size_t i = 0; i < n_references; i++) {
        references[i] = (fmi2ValueReference)strtoul(argv[6 + i], NULL, 10);
    }
    fmi2InstantiateTYPE *instantiate;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetRealTYPE *set_real;
    fmi2GetRealTYPE *get_real;
    fmi2DoStepTYPE *do_step;
    fmi2TerminateTYPE *terminate;
    fmi2FreeInstanceTYPE *free_instance;
    void *library = open_library(argv[1]);
    find(library, "fmi2Instantiate", &instantiate);
    find(library, "fmi2EnterInitializationMode", &enter);
    find(library, "fmi2ExitInitializationMode", &leave);
    find(library, "fmi2SetReal", &set_real);
    find(library, "fmi2GetReal", &get_real);
    find(library, "fmi2DoStep", &do_step);
    find(library, "fmi2Terminate", &terminate);
    find(library, "fmi2FreeInstance", &free_instance);

    const fmi2CallbackFunctions callbacks = {print_message, calloc, free, NULL, NULL};
    fmi2Component fmu = instantiate("host", fmi2CoSimulation, argv[2], argv[3], &callbacks, fmi2False, fmi2True);
    FILE *signals = fopen(argv[argc - 1], "rb");
    if (fmu == NULL || signals == NULL) {
        fail("cannot begin with", fmu == NULL ? argv[1] : argv[argc - 1]);
    }
    const size_t width = n_inputs > 0 ? n_inputs : 1;
    double row[MAX_REFERENCES], outputs[MAX_REFERENCES];
    for (unsigned long k = 0; fread(row, sizeof row[0], width, signals) == width; k++) {
        if (k == 0) {
            check(enter(fmu), "fmi2EnterInitializationMode");
            check(set_real(fmu, references, n_inputs, row), "fmi2SetReal");
            check(leave(fmu), "fmi2ExitInitializationMode");
        }
        check(set_real(fmu, references, n_inputs, row), "fmi2SetReal");
        check(do_step(fmu, (double)k * h, h, fmi2True), "fmi2DoStep");
        check(get_real(fmu, references + n_inputs, n_references - n_inputs, outputs), "fmi2GetReal");
        for (size_t i = 0; i < n_references - n_inputs; i++) {
            printf("%a%c", outputs[i], i + 1 < n_references - n_inputs ? ' ' : '\n');
        }
    }
    fclose(signals);
    check(terminate(fmu), "fmi2Terminate");
    free_instance(fmu);
    return 0;
}

/* Three FMUs linked into one program: the trajectory through the predictor to the plant, step by step.
 *
 * three_fmus STEPS RESOURCES, the latter being the trajectory's. Prints r, x_d, x_h and x_meas of every sample as
 * hexadecimal floats. wiring.h names the GUIDs and the value references, as the modelDescriptions have them.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"
#include "wiring.h"

#define STEP_SIZE 1e-3 /* s */

/* The functions of an FMU that are called here, under the names that FMI2_FUNCTION_PREFIX gives them. */
typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *exit;
    fmi2SetRealTYPE *set;
    fmi2GetRealTYPE *get;
    fmi2DoStepTYPE *step;
    fmi2FreeInstanceTYPE *release;
    fmi2Component instance;
} fmu;

#define DECLARE(model) \
    extern fmi2InstantiateTYPE model##_fmi2Instantiate; \
    extern fmi2EnterInitializationModeTYPE model##_fmi2EnterInitializationMode; \
    extern fmi2ExitInitializationModeTYPE model##_fmi2ExitInitializationMode; \
    extern fmi2SetRealTYPE model##_fmi2SetReal; \
    extern fmi2GetRealTYPE model##_fmi2GetReal; \
    extern fmi2DoStepTYPE model##_fmi2DoStep; \
    extern fmi2FreeInstanceTYPE model##_fmi2FreeInstance;

#define FUNCTIONS(model) \
    {model##_fmi2Instantiate, \
     model##_fmi2EnterInitializationMode, \
     model##_fmi2ExitInitializationMode, \
     model##_fmi2SetReal, \
     model##_fmi2GetReal, \
     model##_fmi2DoStep, \
     model##_fmi2FreeInstance, \
     NULL}

DECLARE(ReferenceTrajectory)
DECLARE(HybridPredictor)
DECLARE(FeedDrive)

static void expect(int held, const char *what)
{
    if (!held) {
        fprintf(stderr, "three_fmus: failed: %s\n", what);
        exit(1);
    }
}

static void logged(
    fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message,
    ...)
{
    va_list arguments;
    (void)environment;
    (void)status;
    (void)category;
    fprintf(stderr, "%s: ", name);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static const fmi2CallbackFunctions callbacks = {logged, calloc, free, NULL, NULL};

static void begin(fmu *self, const char *name, const char *guid, const char *resources)
{
    self->instance = self->instantiate(name, fmi2CoSimulation, guid, resources, &callbacks, fmi2False, fmi2False);
    expect(self->instance != NULL, "an instance");
    expect(self->enter(self->instance) == fmi2OK && self->exit(self->instance) == fmi2OK, "an initialization");
}

static double get(const fmu *self, fmi2ValueReference reference)
{
    double value = 0.0;
    expect(self->get(self->instance, &reference, 1, &value) == fmi2OK, "an output");
    return value;
}

static void set(const fmu *self, fmi2ValueReference reference, double value)
{
    expect(self->set(self->instance, &reference, 1, &value) == fmi2OK, "an input");
}

int main(int n_arguments, char *arguments[])
{
    fmu reference = FUNCTIONS(ReferenceTrajectory);
    fmu predictor = FUNCTIONS(HybridPredictor);
    fmu plant = FUNCTIONS(FeedDrive);
    expect(n_arguments == 3, "two arguments");
    const long steps = strtol(arguments[1], NULL, 10);
    begin(&reference, "reference", REFERENCE_GUID, arguments[2]);
    begin(&predictor, "predictor", PREDICTOR_GUID, NULL);
    begin(&plant, "plant", PLANT_GUID, NULL);
    for (long k = 0; k < steps; k++) {
        const double t = (double)k * STEP_SIZE;
        const double r = get(&reference, REFERENCE_r), x_d = get(&predictor, PREDICTOR_x_d);
        const double x_meas = get(&plant, PLANT_x_meas);
        printf("%a %a %a %a\n", r, x_d, get(&predictor, PREDICTOR_x_h), x_meas);
        set(&predictor, PREDICTOR_x_d_ahead, r);
        set(&predictor, PREDICTOR_x_meas, x_meas);
        set(&plant, PLANT_x_d, x_d);
        expect(reference.step(reference.instance, t, STEP_SIZE, fmi2True) == fmi2OK, "a step of the reference");
        expect(predictor.step(predictor.instance, t, STEP_SIZE, fmi2True) == fmi2OK, "a step of the predictor");
        expect(plant.step(plant.instance, t, STEP_SIZE, fmi2True) == fmi2OK, "a step of the plant");
    }
    reference.release(reference.instance);
    predictor.release(predictor.instance);
    plant.release(plant.instance);
    return 0;
}

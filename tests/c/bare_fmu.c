/* A HybridPredictor (FMI 2.0) that plays samples on a board: a line with the bits of x_h for each, hexadecimal.
 *
 * wiring.h has the GUID, value references, the resources' location and the samples, (n, 2), m: x_d_ahead, x_meas.
 */
#include "fmi2Functions.h"

#include "hexadecimal.h"
#include "wiring.h"

#define STEP_SIZE 1e-3 /* s */

#ifdef HSEP_NO_MALLOC
static double memory[100000];
static size_t used;

/* Blocks are never given back: one instance lives as long as the program. */
void *hsep_target_calloc(size_t count, size_t size);
void hsep_target_free(void *block);

void *hsep_target_calloc(size_t count, size_t size)
{
    const size_t needed = (count * size + sizeof(double) - 1) / sizeof(double);
    if (needed > sizeof memory / sizeof memory[0] - used) {
        return NULL;
    }
    used += needed;
    return &memory[used - needed];
}

void hsep_target_free(void *block) { (void)block; }
#endif

static void logged(
    fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message,
    ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    board_write(message);
    board_write("\n");
}

int main(void)
{
    static const fmi2CallbackFunctions callbacks = {.logger = logged, .allocateMemory = NULL, .freeMemory = NULL};
    static const fmi2ValueReference inputs[2] = {VR_x_d_ahead, VR_x_meas}, output = VR_x_h;
    fmi2Real x_h;
    board_init();
    fmi2Component predictor = fmi2Instantiate("p", fmi2CoSimulation, GUID, RESOURCES, &callbacks, fmi2False, fmi2True);
    if (predictor == NULL || fmi2SetupExperiment(predictor, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK ||
        fmi2EnterInitializationMode(predictor) != fmi2OK || fmi2SetReal(predictor, inputs, 2, samples[0]) != fmi2OK ||
        fmi2ExitInitializationMode(predictor) != fmi2OK) {
        return 1;
    }
    for (size_t k = 0; k < sizeof samples / sizeof samples[0]; k++) {
        if (fmi2SetReal(predictor, inputs, 2, samples[k]) != fmi2OK ||
            fmi2DoStep(predictor, (double)k * STEP_SIZE, STEP_SIZE, fmi2True) != fmi2OK ||
            fmi2GetReal(predictor, &output, 1, &x_h) != fmi2OK) {
            return 1;
        }
        write_bits(x_h);
        board_write("\n");
    }
    fmi2FreeInstance(predictor);
    return 0;
}

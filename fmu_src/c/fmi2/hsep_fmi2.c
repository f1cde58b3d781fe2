/* FMI 2.0 for co-simulation: instances, experiments, steps and saved states. Every number comes from the model. */
#include "hsep_fmi2_calls.h"

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return "2.0"; }

/* The logger reads its message as printf does: a percent sign in ours stands for itself. */
static void fmi2_hand(const hsep_component *component, int status, const char *category, const char *text)
{
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)component->logger;
    char escaped[4 * HSEP_MESSAGE_SIZE]; /* a text is half as long */
    size_t n = 0;
    for (const char *c = text; *c != '\0'; c++) {
        if (*c == '%') {
            escaped[n++] = '%';
        }
        escaped[n++] = *c;
    }
    escaped[n] = '\0';
    const char *name = component->instance.name;
    logger(component->environment, (name == NULL) ? HSEP_MODEL_NAME : name, (fmi2Status)status, category, escaped);
}

fmi2Component fmi2Instantiate(
    fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const int own_memory = functions == NULL || functions->allocateMemory == NULL || functions->freeMemory == NULL;
    hsep_component filled = {.hand = fmi2_hand, .categories = HSEP_LOG_ERROR};
    (void)visible;
    filled.instance.names = hsep_fmi2_names();
    filled.instance.allocate = own_memory ? HSEP_CALLOC : functions->allocateMemory;
    filled.instance.release = own_memory ? HSEP_FREE : functions->freeMemory;
    if (functions != NULL) {
        filled.logger = (void (*)(void))functions->logger;
        filled.environment = functions->componentEnvironment;
    }
    if (fmuType != fmi2CoSimulation) {
        (void)hsep_refuse(&filled.instance, "fmi2Instantiate: fmuType must be fmi2CoSimulation, got %d", (int)fmuType);
        return NULL;
    }
    return hsep_component_new(&filled, instanceName, fmuGUID, fmuResourceLocation, loggingOn);
}

HSEP_COMMON_FUNCTIONS(fmi2, Component, FMUstate, DeSerialize, HSEP_FMI2)

fmi2Status fmi2SetupExperiment(
    fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined,
    fmi2Real stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    return hsep_fmi2_status(hsep_call_experiment(c, HSEP_FMI2(SETUP_EXPERIMENT), startTime, stopTimeDefined, stopTime));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return hsep_fmi2_status(hsep_call_phase(c, HSEP_FMI2(ENTER_INITIALIZATION_MODE), HSEP_INITIALIZATION));
}

fmi2Status fmi2DoStep(
    fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    return hsep_fmi2_status(hsep_call_step(c, HSEP_FMI2(DO_STEP), currentCommunicationPoint, communicationStepSize));
}

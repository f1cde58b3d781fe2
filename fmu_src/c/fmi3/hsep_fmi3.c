/* FMI 3.0 for co-simulation: instances, experiments, steps and saved states. Every number comes from the model. */
#include "hsep_fmi3_calls.h"

const char *fmi3GetVersion(void) { return "3.0"; }

static void fmi3_hand(const hsep_component *component, int status, const char *category, const char *text)
{
    const fmi3LogMessageCallback logger = (fmi3LogMessageCallback)component->logger;
    logger(component->environment, (fmi3Status)status, category, text);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    hsep_component filled = {.hand = fmi3_hand, .categories = HSEP_LOG_ERROR};
    /* An early return is allowed, never needed; without intermediate updates there is nothing to ask for in them. */
    (void)visible, (void)earlyReturnAllowed, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    filled.instance.names = hsep_fmi3_names();
    filled.instance.allocate = HSEP_CALLOC;
    filled.instance.release = HSEP_FREE;
    filled.logger = (void (*)(void))logMessage;
    filled.environment = instanceEnvironment;
    if (eventModeUsed) {
        (void)hsep_refuse(
            &filled.instance, "fmi3InstantiateCoSimulation: eventModeUsed must be false, as hasEventMode is in "
                              "modelDescription.xml");
        return NULL;
    }
    if (nRequiredIntermediateVariables > 0) {
        (void)hsep_refuse(
            &filled.instance,
            "fmi3InstantiateCoSimulation: nRequiredIntermediateVariables must be 0, as providesIntermediateUpdate is "
            "false in modelDescription.xml, got %lu",
            (unsigned long)nRequiredIntermediateVariables);
        return NULL;
    }
    return hsep_component_new(&filled, instanceName, instantiationToken, resourcePath, loggingOn);
}

HSEP_COMMON_FUNCTIONS(fmi3, Instance, FMUState, Deserialize, HSEP_FMI3)

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    hsep_instance *self = hsep_begin(instance, HSEP_FMI3(ENTER_CONFIGURATION_MODE));
    if (self != NULL && self->context.window == 0) {
        return hsep_fmi3_status(
            hsep_refuse(self, "fmi3EnterConfigurationMode: there is no structural parameter in modelDescription.xml"));
    }
    return hsep_fmi3_status(hsep_call_phase(instance, HSEP_FMI3(ENTER_CONFIGURATION_MODE), HSEP_CONFIGURATION));
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return hsep_fmi3_status(hsep_call_phase(instance, HSEP_FMI3(EXIT_CONFIGURATION_MODE), HSEP_INSTANTIATED));
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
    fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    const hsep_call *call = HSEP_FMI3(ENTER_INITIALIZATION_MODE);
    (void)toleranceDefined, (void)tolerance;
    if (hsep_call_experiment(instance, call, startTime, stopTimeDefined, stopTime) != HSEP_OK) {
        return fmi3Error;
    }
    return hsep_fmi3_status(hsep_call_phase(instance, call, HSEP_INITIALIZATION));
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
    fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
    fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    const hsep_call *call = HSEP_FMI3(DO_STEP);
    hsep_instance *self = hsep_begin(instance, call);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (self == NULL) {
        return fmi3Error;
    }
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL) {
        return hsep_fmi3_status(hsep_refuse(self, "fmi3DoStep: a place for what it returns is NULL"));
    }
    const hsep_status status = hsep_call_step(instance, call, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = self->experiment.time;
    return hsep_fmi3_status(status);
}

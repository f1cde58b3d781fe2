/* FMI 2.0 for co-simulation: the experiment, the initialization and the steps. Every number comes from the model. */
#include "hsep_fmi2_instance.h"

#include <math.h>

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Status fmi2SetupExperiment(
    fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined,
    fmi2Real stopTime)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_SETUP_EXPERIMENT);
    (void)toleranceDefined;
    (void)tolerance;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (!isfinite(startTime)) {
        return hsep_refuse(instance, "fmi2SetupExperiment: startTime must be finite, got %g s", startTime);
    }
    if (stopTimeDefined && !(stopTime >= startTime)) {
        return hsep_refuse(
            instance, "fmi2SetupExperiment: stopTime must be >= startTime = %g s, got %g s", startTime, stopTime);
    }
    instance->experiment = (hsep_experiment){
        .phase = instance->experiment.phase,
        .has_stop_time = stopTimeDefined ? 1U : 0U,
        .start_time = startTime,
        .stop_time = stopTimeDefined ? stopTime : 0.0,
        .time = startTime};
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_ENTER_INITIALIZATION_MODE);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->experiment.phase = HSEP_INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_EXIT_INITIALIZATION_MODE);
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL) {
        return fmi2Error;
    }
    if (hsep_instance_initialise(instance, "fmi2ExitInitializationMode", message) != HSEP_OK) {
        return hsep_refuse(instance, "%s", message);
    }
    hsep_log(
        instance, HSEP_LOG_ALL, "initialized at %g s with a state of %lu bytes", instance->experiment.start_time,
        (unsigned long)instance->state_size);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_TERMINATE);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->experiment.phase = HSEP_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2DoStep(
    fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_DO_STEP);
    hsep_component *component = c;
    char message[HSEP_MESSAGE_SIZE] = "";
    (void)noSetFMUStatePriorToCurrentPoint;
    if (instance == NULL) {
        return fmi2Error;
    }
    const hsep_status status =
        hsep_instance_step(instance, "fmi2DoStep", currentCommunicationPoint, communicationStepSize, message);
    if (status == HSEP_REFUSED) {
        return hsep_refuse(instance, "%s", message);
    }
    if (status == HSEP_WARNED && !component->warned) { /* once an instance, not at each of many steps */
        component->warned = 1;
        hsep_log(instance, HSEP_LOG_WARNING, "fmi2DoStep: %s", message);
    }
    return fmi2OK;
}

/* Steps are never pending and no output has a derivative: what asks for it is refused. */

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)hsep_begin(c, HSEP_CALL_CANCEL_STEP);
    return fmi2Error;
}

static fmi2Status hsep_unsupported(fmi2Component c, hsep_call call, const char *capability)
{
    hsep_instance *instance = hsep_begin(c, call);
    if (instance == NULL) {
        return fmi2Error;
    }
    return hsep_refuse(instance, "%s is not supported: %s in modelDescription.xml", hsep_calls[call].name, capability);
}

fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return hsep_unsupported(c, HSEP_CALL_GET_REAL_OUTPUT_DERIVATIVES, "maxOutputDerivativeOrder is 0");
}

fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown, const fmi2ValueReference vKnown_ref[],
    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return hsep_unsupported(c, HSEP_CALL_GET_DIRECTIONAL_DERIVATIVE, "providesDirectionalDerivative is false");
}

/* Status of a slave whose steps are never pending: the last communication point, and that it has not terminated. */

/* The status of an answer: fmi2OK with the instance if it is known, and there is a place for it. */
static fmi2Status hsep_answer(fmi2Component c, hsep_call call, const void *value, int known, hsep_instance **instance)
{
    *instance = hsep_begin(c, call);
    if (*instance == NULL) {
        return fmi2Error;
    }
    if (value == NULL) {
        return hsep_refuse(*instance, "%s: value is NULL", hsep_calls[call].name);
    }
    if (!known) {
        hsep_log(
            *instance, HSEP_LOG_DISCARD, "%s: this status does not exist, because no step is ever pending",
            hsep_calls[call].name);
        return fmi2Discard;
    }
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    hsep_instance *instance;
    (void)s;
    return hsep_answer(c, HSEP_CALL_GET_STATUS, value, 0, &instance);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    hsep_instance *instance;
    const fmi2Status status = hsep_answer(c, HSEP_CALL_GET_REAL_STATUS, value, s == fmi2LastSuccessfulTime, &instance);
    if (status == fmi2OK) {
        *value = instance->experiment.time;
    }
    return status;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    hsep_instance *instance;
    (void)s;
    return hsep_answer(c, HSEP_CALL_GET_INTEGER_STATUS, value, 0, &instance);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    hsep_instance *instance;
    const fmi2Status status = hsep_answer(c, HSEP_CALL_GET_BOOLEAN_STATUS, value, s == fmi2Terminated, &instance);
    if (status == fmi2OK) {
        *value = fmi2False;
    }
    return status;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    hsep_instance *instance;
    (void)s;
    return hsep_answer(c, HSEP_CALL_GET_STRING_STATUS, value, 0, &instance);
}

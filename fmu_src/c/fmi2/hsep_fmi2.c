/* FMI 2.0 for co-simulation: the experiment, the initialization and the steps. Every number comes from the model. */
#include "hsep_fmi2_instance.h"

#include <math.h>

static const double stop_tolerance = 1e-6; /* of a step: a last step that ended at the stop time but for rounding */

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
    instance->start_time = startTime;
    instance->time = startTime;
    instance->has_stop_time = stopTimeDefined ? 1 : 0;
    instance->stop_time = stopTimeDefined ? stopTime : 0.0;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_ENTER_INITIALIZATION_MODE);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->phase = HSEP_INITIALIZATION;
    return fmi2OK;
}

/* All memory of the simulation is taken here. If the parameters do not fit, they may be corrected and it called
 * again. */
fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_EXIT_INITIALIZATION_MODE);
    char message[HSEP_MESSAGE_SIZE] = "";
    size_t size = 0;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (hsep_model_size(&instance->context, instance->values, &size, message) != HSEP_OK) {
        return hsep_refuse(instance, "%s", message);
    }
    instance->state = hsep_new(instance, size);
    if (instance->state == NULL) {
        return hsep_refuse(
            instance, "fmi2ExitInitializationMode: no memory for a state of %lu bytes", (unsigned long)size);
    }
    instance->state_size = size;
    if (hsep_model_initialise(
            &instance->context, instance->state, size, instance->values, instance->start_time, message) != HSEP_OK) {
        hsep_drop_state(instance);
        return hsep_refuse(instance, "%s", message);
    }
    instance->phase = HSEP_STEPPING;
    hsep_log(
        instance, HSEP_LOG_ALL, "initialized at %g s with a state of %lu bytes", instance->start_time,
        (unsigned long)size);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_TERMINATE);
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->phase = HSEP_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2DoStep(
    fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
    fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_DO_STEP);
    const double end = currentCommunicationPoint + communicationStepSize;
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_status status;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (instance->has_stop_time &&
        currentCommunicationPoint >= instance->stop_time - stop_tolerance * communicationStepSize) {
        return hsep_refuse(
            instance, "fmi2DoStep: a step must begin before the stop time %.9g s, got one from %.9g s",
            instance->stop_time, currentCommunicationPoint);
    }
    status = hsep_model_step(
        &instance->context, instance->state, instance->values, currentCommunicationPoint, communicationStepSize,
        message);
    if (status == HSEP_REFUSED) {
        return hsep_refuse(instance, "%s", message);
    }
    if (status == HSEP_WARNED && !instance->warned) { /* once an instance, not at each of many steps */
        instance->warned = 1;
        hsep_log(instance, HSEP_LOG_WARNING, "fmi2DoStep: %s", message);
    }
    for (size_t i = HSEP_N_VARIABLES; i < HSEP_N_VALUES; ++i) { /* time derivatives are for one step */
        instance->values[i] = 0.0;
    }
    instance->time = end;
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

/* What a slave whose steps are never pending knows of its status: the time it reached and that it has not ended. */

static fmi2Status hsep_discard(hsep_instance *instance, hsep_call call)
{
    hsep_log(
        instance, HSEP_LOG_DISCARD, "%s: there is nothing of this kind to tell, no step is ever pending",
        hsep_calls[call].name);
    return fmi2Discard;
}

/* The instance if the call is legal and there is a place for the answer. */
static hsep_instance *hsep_asked(fmi2Component c, hsep_call call, const void *value)
{
    hsep_instance *instance = hsep_begin(c, call);
    if (instance != NULL && value == NULL) {
        (void)hsep_refuse(instance, "%s: value is NULL", hsep_calls[call].name);
        return NULL;
    }
    return instance;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    hsep_instance *instance = hsep_asked(c, HSEP_CALL_GET_STATUS, value);
    (void)s;
    return (instance == NULL) ? fmi2Error : hsep_discard(instance, HSEP_CALL_GET_STATUS);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    hsep_instance *instance = hsep_asked(c, HSEP_CALL_GET_REAL_STATUS, value);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return hsep_discard(instance, HSEP_CALL_GET_REAL_STATUS);
    }
    *value = instance->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    hsep_instance *instance = hsep_asked(c, HSEP_CALL_GET_INTEGER_STATUS, value);
    (void)s;
    return (instance == NULL) ? fmi2Error : hsep_discard(instance, HSEP_CALL_GET_INTEGER_STATUS);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    hsep_instance *instance = hsep_asked(c, HSEP_CALL_GET_BOOLEAN_STATUS, value);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return hsep_discard(instance, HSEP_CALL_GET_BOOLEAN_STATUS);
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    hsep_instance *instance = hsep_asked(c, HSEP_CALL_GET_STRING_STATUS, value);
    (void)s;
    return (instance == NULL) ? fmi2Error : hsep_discard(instance, HSEP_CALL_GET_STRING_STATUS);
}

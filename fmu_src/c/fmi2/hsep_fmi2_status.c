/* Status of a slave whose steps are never pending, and what is refused because no output has a derivative. */
#include "hsep_fmi2_calls.h"

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)hsep_begin(c, HSEP_FMI2(CANCEL_STEP));
    return fmi2Error;
}

static fmi2Status fmi2_unsupported(fmi2Component c, const hsep_call *call, const char *capability)
{
    hsep_instance *instance = hsep_begin(c, call);
    if (instance != NULL) {
        (void)hsep_refuse(instance, "%s is not supported: %s in modelDescription.xml", call->name, capability);
    }
    return fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return fmi2_unsupported(c, HSEP_FMI2(GET_REAL_OUTPUT_DERIVATIVES), "maxOutputDerivativeOrder is 0");
}

fmi2Status fmi2GetDirectionalDerivative(
    fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown, const fmi2ValueReference vKnown_ref[],
    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return fmi2_unsupported(c, HSEP_FMI2(GET_DIRECTIONAL_DERIVATIVE), "providesDirectionalDerivative is false");
}

/* The status of an answer: fmi2OK with the instance if it is known, and there is a place for it. */
static fmi2Status fmi2_answer(
    fmi2Component c, const hsep_call *call, const void *value, int known, hsep_instance **instance)
{
    *instance = hsep_begin(c, call);
    if (*instance == NULL) {
        return fmi2Error;
    }
    if (value == NULL) {
        (void)hsep_refuse(*instance, "%s: value is NULL", call->name);
        return fmi2Error;
    }
    if (!known) {
        hsep_log(
            *instance, HSEP_LOG_DISCARD, "%s: this status does not exist, because no step is ever pending", call->name);
        return fmi2Discard;
    }
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    hsep_instance *instance;
    (void)s;
    return fmi2_answer(c, HSEP_FMI2(GET_STATUS), value, 0, &instance);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    hsep_instance *instance;
    const fmi2Status status = fmi2_answer(c, HSEP_FMI2(GET_REAL_STATUS), value, s == fmi2LastSuccessfulTime, &instance);
    if (status == fmi2OK) {
        *value = instance->experiment.time;
    }
    return status;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    hsep_instance *instance;
    (void)s;
    return fmi2_answer(c, HSEP_FMI2(GET_INTEGER_STATUS), value, 0, &instance);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    hsep_instance *instance;
    const fmi2Status status = fmi2_answer(c, HSEP_FMI2(GET_BOOLEAN_STATUS), value, s == fmi2Terminated, &instance);
    if (status == fmi2OK) {
        *value = fmi2False;
    }
    return status;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    hsep_instance *instance;
    (void)s;
    return fmi2_answer(c, HSEP_FMI2(GET_STRING_STATUS), value, 0, &instance);
}

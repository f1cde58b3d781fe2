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

/* The functions that get a status: whether that one, s, is known, and its value. */
#define FMI2_STATUS(function, call, type, known, answer) \
    fmi2Status function(fmi2Component c, const fmi2StatusKind s, type *value) \
    { \
        hsep_instance *instance = hsep_begin(c, HSEP_FMI2(call)); \
        (void)s; \
        if (instance == NULL) { \
            return fmi2Error; \
        } \
        if (value == NULL) { \
            return hsep_fmi2_status(hsep_refuse(instance, #function ": value is NULL")); \
        } \
        if (!(known)) { \
            hsep_log( \
                instance, HSEP_LOG_DISCARD, \
                #function ": this status does not exist, because no step is ever pending"); \
            return fmi2Discard; \
        } \
        *value = answer; \
        return fmi2OK; \
    }

FMI2_STATUS(fmi2GetStatus, GET_STATUS, fmi2Status, 0, fmi2OK)
FMI2_STATUS(fmi2GetRealStatus, GET_REAL_STATUS, fmi2Real, s == fmi2LastSuccessfulTime, instance->experiment.time)
FMI2_STATUS(fmi2GetIntegerStatus, GET_INTEGER_STATUS, fmi2Integer, 0, 0)
FMI2_STATUS(fmi2GetBooleanStatus, GET_BOOLEAN_STATUS, fmi2Boolean, s == fmi2Terminated, fmi2False)
FMI2_STATUS(fmi2GetStringStatus, GET_STRING_STATUS, fmi2String, 0, NULL)

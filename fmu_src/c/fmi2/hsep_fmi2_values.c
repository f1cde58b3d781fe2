/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi2_calls.h"

#include <math.h>

/* What is read or written, of a kind's type. */
static hsep_access fmi2_access(hsep_kind kind, const fmi2ValueReference vr[], size_t n, const void *value)
{
    return (hsep_access){
        .type = hsep_fmi2_words()->types[kind], .references = vr, .n_references = n, .values = value, .n_values = n};
}

/* There are no variables of type String: with references, the access is refused by name. */
static hsep_access fmi2_strings(const fmi2ValueReference vr[], size_t n, const void *value)
{
    hsep_access access = fmi2_access(HSEP_REAL, vr, n, value);
    access.type = "String";
    return access;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    const hsep_instance *instance = hsep_call_get(c, HSEP_FMI2(GET_REAL), fmi2_access(HSEP_REAL, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = instance->values[vr[i]];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    const hsep_instance *instance = hsep_call_get(c, HSEP_FMI2(GET_INTEGER), fmi2_access(HSEP_INTEGER, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = hsep_values_integer(instance->values[vr[i]]);
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    const hsep_instance *instance = hsep_call_get(c, HSEP_FMI2(GET_BOOLEAN), fmi2_access(HSEP_BOOLEAN, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = (instance->values[vr[i]] != 0.0) ? fmi2True : fmi2False;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return (hsep_call_get(c, HSEP_FMI2(GET_STRING), fmi2_strings(vr, nvr, value)) == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    hsep_instance *instance = hsep_call_set(c, HSEP_FMI2(SET_REAL), fmi2_access(HSEP_REAL, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    hsep_instance *instance = hsep_call_set(c, HSEP_FMI2(SET_INTEGER), fmi2_access(HSEP_INTEGER, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = (double)value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    hsep_instance *instance = hsep_call_set(c, HSEP_FMI2(SET_BOOLEAN), fmi2_access(HSEP_BOOLEAN, vr, nvr, value));
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = value[i] ? 1.0 : 0.0;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return (hsep_call_set(c, HSEP_FMI2(SET_STRING), fmi2_strings(vr, nvr, value)) == NULL) ? fmi2Error : fmi2OK;
}

/* Why one of the derivatives cannot be taken; HSEP_OK if all can. */
static hsep_status fmi2_check_derivatives(
    hsep_instance *instance, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
    const fmi2Real value[])
{
    static const char name[] = "fmi2SetRealInputDerivatives";
    char input[HSEP_NAME_SIZE];
    if (HSEP_N_INTERPOLATED == 0) {
        return hsep_refuse(
            instance, "%s is not supported: canInterpolateInputs is false in modelDescription.xml", name);
    }
    if (nvr > 0 && order == NULL) {
        return hsep_refuse(instance, "%s: order is NULL, but nvr is %lu", name, (unsigned long)nvr);
    }
    for (size_t i = 0; i < nvr; i++) {
        if (vr[i] + 1 > HSEP_N_INTERPOLATED) {
            return hsep_refuse(
                instance, "%s: %s takes no derivative, only inputs do", name,
                hsep_table_name(&instance->context, vr[i], input));
        }
        if (order[i] != 1) {
            return hsep_refuse(
                instance, "%s: the order of %s must be 1, got %d", name,
                hsep_table_name(&instance->context, vr[i], input), (int)order[i]);
        }
        if (!isfinite(value[i])) {
            return hsep_refuse(
                instance, "%s: the derivative of %s must be finite, got %g", name,
                hsep_table_name(&instance->context, vr[i], input), value[i]);
        }
    }
    return HSEP_OK;
}

/* The derivatives count for the next step alone. Like the values, none is taken if one is refused. */
fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    const hsep_call *call = HSEP_FMI2(SET_REAL_INPUT_DERIVATIVES);
    hsep_access access = fmi2_access(HSEP_REAL, vr, nvr, value);
    hsep_instance *instance = hsep_begin(c, call);
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL) {
        return fmi2Error;
    }
    access.call = call->name;
    if (hsep_values_check(instance, &access, message) != HSEP_OK) {
        (void)hsep_refuse(instance, "%s", message);
        return fmi2Error;
    }
    if (fmi2_check_derivatives(instance, vr, nvr, order, value) != HSEP_OK) {
        return fmi2Error;
    }
    for (size_t i = 0; i < nvr; i++) {
        instance->values[instance->context.n_variables + vr[i]] = value[i];
    }
    return fmi2OK;
}

/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi2_instance.h"

#include "hsep_table.h"
#include "hsep_values.h"

#include <math.h>

/* The instance if the call is legal, every reference is one of that kind and what is set may be; otherwise NULL, with a
 * message. */
static hsep_instance *hsep_access(
    fmi2Component c, hsep_call call, hsep_kind kind, const fmi2ValueReference vr[], size_t n, const void *value)
{
    const char *name = hsep_calls[call].name;
    const int gets = call >= HSEP_CALL_GET_REAL && call <= HSEP_CALL_GET_STRING;
    const int sets = call >= HSEP_CALL_SET_REAL && call <= HSEP_CALL_SET_STRING;
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_instance *instance = hsep_begin(c, call);
    if (instance == NULL) {
        return NULL;
    }
    if (hsep_values_check(instance, name, kind, vr, n, value, message) != HSEP_OK ||
        (sets && hsep_values_check_set(instance, name, "fmi2Reset", vr, n, message) != HSEP_OK) ||
        (gets && hsep_values_prepare(instance, name, vr, n, message) != HSEP_OK)) {
        (void)hsep_refuse(instance, "%s", message);
        return NULL;
    }
    return instance;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    const hsep_instance *instance = hsep_access(c, HSEP_CALL_GET_REAL, HSEP_REAL, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = instance->values[vr[i]];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    const hsep_instance *instance = hsep_access(c, HSEP_CALL_GET_INTEGER, HSEP_INTEGER, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = hsep_values_integer(instance->values[vr[i]]);
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    const hsep_instance *instance = hsep_access(c, HSEP_CALL_GET_BOOLEAN, HSEP_BOOLEAN, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        value[i] = (instance->values[vr[i]] != 0.0) ? fmi2True : fmi2False;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

/* There are no variables of type String: with references, the access is refused by name. */
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return (hsep_access(c, HSEP_CALL_GET_STRING, HSEP_STRING, vr, nvr, value) == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    hsep_instance *instance = hsep_access(c, HSEP_CALL_SET_REAL, HSEP_REAL, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    hsep_instance *instance = hsep_access(c, HSEP_CALL_SET_INTEGER, HSEP_INTEGER, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = (double)value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    hsep_instance *instance = hsep_access(c, HSEP_CALL_SET_BOOLEAN, HSEP_BOOLEAN, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; i++) {
        instance->values[vr[i]] = value[i] ? 1.0 : 0.0;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return (hsep_access(c, HSEP_CALL_SET_STRING, HSEP_STRING, vr, nvr, value) == NULL) ? fmi2Error : fmi2OK;
}

/* The derivatives count for the next step alone. Like the values, none is taken if one is refused. */
fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    static const char name[] = "fmi2SetRealInputDerivatives";
    char input[HSEP_NAME_SIZE];
    hsep_instance *instance = hsep_access(c, HSEP_CALL_SET_REAL_INPUT_DERIVATIVES, HSEP_REAL, vr, nvr, value);
    if (instance == NULL) {
        return fmi2Error;
    }
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
    for (size_t i = 0; i < nvr; i++) {
        instance->values[instance->context.n_variables + vr[i]] = value[i];
    }
    return fmi2OK;
}

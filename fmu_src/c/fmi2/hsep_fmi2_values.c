/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi2_instance.h"

#include <limits.h>
#include <math.h>

static const char *const hsep_kind_names[] = {"Real", "Integer", "Boolean", "String"};
static const char *const hsep_causality_names[] = {"an input", "an output", "a parameter", "a local variable"};

/* The instance if the call is legal and every reference is one of that kind; otherwise NULL, with a message. */
static hsep_instance *hsep_access(
    fmi2Component c, hsep_call call, hsep_kind kind, const fmi2ValueReference vr[], size_t n, const void *value)
{
    hsep_instance *instance = hsep_begin(c, call);
    const char *name = hsep_calls[call].name;
    if (instance == NULL) {
        return NULL;
    }
    if (n > 0 && (vr == NULL || value == NULL)) {
        (void)hsep_refuse(
            instance, "%s: %s is NULL, but nvr is %lu", name, (vr == NULL) ? "vr" : "value", (unsigned long)n);
        return NULL;
    }
    for (size_t i = 0; i < n; ++i) {
        if (vr[i] >= HSEP_N_VARIABLES) {
            (void)hsep_refuse(
                instance, "%s: value reference must be 0 ... %d, got %u", name, HSEP_N_VARIABLES - 1, vr[i]);
            return NULL;
        }
        if (hsep_variables[vr[i]].kind != kind) {
            (void)hsep_refuse(
                instance, "%s: %s (value reference %u) is of type %s, not %s", name, hsep_variables[vr[i]].name, vr[i],
                hsep_kind_names[hsep_variables[vr[i]].kind], hsep_kind_names[kind]);
            return NULL;
        }
    }
    return instance;
}

/* The same for reading; before the initialization has ended the calculated values follow from the start values. */
static hsep_instance *hsep_reading(
    fmi2Component c, hsep_call call, hsep_kind kind, const fmi2ValueReference vr[], size_t n, const void *value)
{
    hsep_instance *instance = hsep_access(c, call, kind, vr, n, value);
    if (instance != NULL && instance->state == NULL) {
        hsep_model_start_values(&instance->context, instance->values);
    }
    return instance;
}

/* The same for writing: inputs at any time, parameters until the initialization has ended, tunable ones later too. */
static hsep_instance *hsep_writing(
    fmi2Component c, hsep_call call, hsep_kind kind, const fmi2ValueReference vr[], size_t n, const void *value)
{
    hsep_instance *instance = hsep_access(c, call, kind, vr, n, value);
    for (size_t i = 0; instance != NULL && i < n; ++i) {
        const hsep_variable *variable = &hsep_variables[vr[i]];
        const char *name = hsep_calls[call].name;
        if (variable->causality != HSEP_INPUT && variable->causality != HSEP_PARAMETER) {
            (void)hsep_refuse(
                instance, "%s: %s is %s and cannot be set", name, variable->name,
                hsep_causality_names[variable->causality]);
            return NULL;
        }
        if (variable->causality == HSEP_PARAMETER && !variable->tunable && instance->phase == HSEP_STEPPING) {
            (void)hsep_refuse(
                instance,
                "%s: %s is a fixed parameter and cannot be set after the initialization; call fmi2Reset first", name,
                variable->name);
            return NULL;
        }
    }
    return instance;
}

static fmi2Integer hsep_as_integer(double number)
{
    if (!(number > (double)INT_MIN)) {
        return INT_MIN;
    }
    return (number < (double)INT_MAX) ? (fmi2Integer)number : INT_MAX;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    const hsep_instance *instance = hsep_reading(c, HSEP_CALL_GET_REAL, HSEP_REAL, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        value[i] = instance->values[vr[i]];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    const hsep_instance *instance = hsep_reading(c, HSEP_CALL_GET_INTEGER, HSEP_INTEGER, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        value[i] = hsep_as_integer(instance->values[vr[i]]);
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    const hsep_instance *instance = hsep_reading(c, HSEP_CALL_GET_BOOLEAN, HSEP_BOOLEAN, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        value[i] = (instance->values[vr[i]] != 0.0) ? fmi2True : fmi2False;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

/* There are no variables of type String: with references, the access is refused by name. */
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return (hsep_reading(c, HSEP_CALL_GET_STRING, HSEP_STRING, vr, nvr, value) == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    hsep_instance *instance = hsep_writing(c, HSEP_CALL_SET_REAL, HSEP_REAL, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        instance->values[vr[i]] = value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    hsep_instance *instance = hsep_writing(c, HSEP_CALL_SET_INTEGER, HSEP_INTEGER, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        instance->values[vr[i]] = (double)value[i];
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    hsep_instance *instance = hsep_writing(c, HSEP_CALL_SET_BOOLEAN, HSEP_BOOLEAN, vr, nvr, value);
    for (size_t i = 0; instance != NULL && i < nvr; ++i) {
        instance->values[vr[i]] = value[i] ? 1.0 : 0.0;
    }
    return (instance == NULL) ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return (hsep_writing(c, HSEP_CALL_SET_STRING, HSEP_STRING, vr, nvr, value) == NULL) ? fmi2Error : fmi2OK;
}

/* The derivatives count for the next step alone. Like the values, none is taken if one is refused. */
fmi2Status fmi2SetRealInputDerivatives(
    fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    static const char name[] = "fmi2SetRealInputDerivatives";
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
    for (size_t i = 0; i < nvr; ++i) {
        if (vr[i] + 1 > HSEP_N_INTERPOLATED) {
            return hsep_refuse(
                instance, "%s: %s takes no derivative, only inputs do", name, hsep_variables[vr[i]].name);
        }
        if (order[i] != 1) {
            return hsep_refuse(
                instance, "%s: the order of %s must be 1, got %d", name, hsep_variables[vr[i]].name, (int)order[i]);
        }
        if (!isfinite(value[i])) {
            return hsep_refuse(
                instance, "%s: the derivative of %s must be finite, got %g", name, hsep_variables[vr[i]].name,
                value[i]);
        }
    }
    for (size_t i = 0; i < nvr; ++i) {
        instance->values[HSEP_N_VARIABLES + vr[i]] = value[i];
    }
    return fmi2OK;
}

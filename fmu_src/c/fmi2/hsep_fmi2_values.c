/* Reading and writing variables. A call is checked as a whole first: if one variable is refused, none is touched. */
#include "hsep_fmi2_calls.h"

#include <math.h>

/* The functions that get and set variables of a type. */
#define FMI2_ACCESS(getter, setter, NAME, c_type, type, get, set) \
    fmi2Status getter(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, c_type value[]) \
    { \
        const hsep_instance *self = hsep_call_access(c, HSEP_FMI2(GET_##NAME), 0, type, vr, nvr, value, nvr); \
        for (size_t i = 0; self != NULL && i < nvr; i++) { \
            const double number = self->values[vr[i]]; \
            value[i] = get; \
        } \
        return (self == NULL) ? fmi2Error : fmi2OK; \
    } \
    fmi2Status setter(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const c_type value[]) \
    { \
        hsep_instance *self = hsep_call_access(c, HSEP_FMI2(SET_##NAME), 1, type, vr, nvr, value, nvr); \
        for (size_t i = 0; self != NULL && i < nvr; i++) { \
            const c_type number = value[i]; \
            self = hsep_call_tune(self, HSEP_FMI2(SET_##NAME), vr[i], set); \
        } \
        for (size_t i = 0; self != NULL && i < nvr; i++) { \
            const c_type number = value[i]; \
            self->values[vr[i]] = set; \
        } \
        return (self == NULL) ? fmi2Error : fmi2OK; \
    }

FMI2_ACCESS(fmi2GetReal, fmi2SetReal, REAL, fmi2Real, hsep_fmi2_names()->types[HSEP_REAL], number, number)
FMI2_ACCESS(
    fmi2GetInteger, fmi2SetInteger, INTEGER, fmi2Integer, hsep_fmi2_names()->types[HSEP_INTEGER],
    hsep_values_integer(number), (double)number)
FMI2_ACCESS(
    fmi2GetBoolean, fmi2SetBoolean, BOOLEAN, fmi2Boolean, hsep_fmi2_names()->types[HSEP_BOOLEAN], number != 0.0,
    number ? 1.0 : 0.0)

/* There are no variables of type String: with references, the access is refused by name. */
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    return hsep_call_access(c, HSEP_FMI2(GET_STRING), 0, "String", vr, nvr, value, nvr) == NULL ? fmi2Error : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    return hsep_call_access(c, HSEP_FMI2(SET_STRING), 1, "String", vr, nvr, value, nvr) == NULL ? fmi2Error : fmi2OK;
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
    const hsep_access access = {call->name, hsep_fmi2_names()->types[HSEP_REAL], vr, nvr, value, nvr};
    hsep_instance *instance = hsep_begin(c, call);
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL) {
        return fmi2Error;
    }
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

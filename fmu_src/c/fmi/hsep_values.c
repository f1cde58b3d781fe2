#include "hsep_values.h"

#include "hsep_check.h"

#include <limits.h>

static const char *const values_kinds[] = {"Real", "Integer", "Boolean", "String"};
static const char *const values_causalities[] = {"an input", "an output", "a parameter", "a local variable"};

HSEP_API hsep_status
hsep_values_check(const char *call, hsep_kind kind, const unsigned vr[], size_t n, const void *value, char message[])
{
    if (n > 0 && (vr == NULL || value == NULL)) {
        return hsep_message_add(
            message, "%s: %s is NULL, but nvr is %lu", call, vr == NULL ? "vr" : "value", (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= HSEP_N_VARIABLES) {
            return hsep_message_add(
                message, "%s: value reference must be 0 ... %d, got %u", call, HSEP_N_VARIABLES - 1, vr[i]);
        }
        const hsep_variable *variable = &hsep_variables[vr[i]];
        if (variable->kind != kind) {
            return hsep_message_add(
                message, "%s: %s (value reference %u) is of type %s, not %s", call, variable->name, vr[i],
                values_kinds[variable->kind], values_kinds[kind]);
        }
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_values_check_set(
    const hsep_instance *instance, const char *call, const char *reset, const unsigned vr[], size_t n, char message[])
{
    for (size_t i = 0; i < n; i++) {
        const hsep_variable *variable = &hsep_variables[vr[i]];
        if (variable->causality != HSEP_INPUT && variable->causality != HSEP_PARAMETER) {
            return hsep_message_add(
                message, "%s: %s is %s and cannot be set", call, variable->name,
                values_causalities[variable->causality]);
        }
        if (variable->causality == HSEP_PARAMETER && !variable->tunable &&
            instance->experiment.phase == HSEP_STEPPING) {
            return hsep_message_add(
                message, "%s: %s is a fixed parameter and cannot be set after the initialization; call %s first", call,
                variable->name, reset);
        }
    }
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_values_prepare(hsep_instance *instance, const char *call, const unsigned vr[], size_t n, char message[])
{
    char reason[HSEP_MESSAGE_SIZE] = "";
    if (instance->state != NULL) {
        return HSEP_OK;
    }
    if (hsep_model_check_start(instance->values, reason) == HSEP_OK) {
        hsep_model_start_values(&instance->context, instance->values);
        return HSEP_OK;
    }
    for (size_t i = 0; i < n; i++) {
        const hsep_variable *variable = &hsep_variables[vr[i]];
        if (variable->causality == HSEP_OUTPUT || variable->causality == HSEP_LOCAL) {
            return hsep_message_add(message, "%s: %s is not known yet: %s", call, variable->name, reason);
        }
    }
    return HSEP_OK;
}

HSEP_API int hsep_values_integer(double number)
{
    if (!(number > (double)INT_MIN)) {
        return INT_MIN;
    }
    return number < (double)INT_MAX ? (int)number : INT_MAX;
}

#include "hsep_values.h"

#include "hsep_check.h"
#include "hsep_table.h"

#include <limits.h>

static const char *const values_kinds[] = {"Real", "Integer", "Boolean", "String"};
static const char *const values_causalities[] = {"an input", "an output", "a parameter", "a local variable"};

HSEP_API hsep_status hsep_values_check(
    const hsep_instance *instance, const char *call, hsep_kind kind, const unsigned vr[], size_t n, const void *value,
    char message[])
{
    const hsep_context *context = &instance->context;
    char name[HSEP_NAME_SIZE];
    if (n > 0 && (vr == NULL || value == NULL)) {
        return hsep_message_add(
            message, "%s: %s is NULL, but nvr is %lu", call, vr == NULL ? "vr" : "value", (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= context->n_variables) {
            return hsep_message_add(
                message, "%s: value reference must be 0 ... %lu, got %u", call, (unsigned long)context->n_variables - 1,
                vr[i]);
        }
        const hsep_variable *variable = hsep_table_row(context, vr[i]);
        if (variable->kind != kind) {
            return hsep_message_add(
                message, "%s: %s (value reference %u) is of type %s, not %s", call,
                hsep_table_name(context, vr[i], name), vr[i], values_kinds[variable->kind], values_kinds[kind]);
        }
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_values_check_set(
    const hsep_instance *instance, const char *call, const char *reset, const unsigned vr[], size_t n, char message[])
{
    const hsep_context *context = &instance->context;
    char name[HSEP_NAME_SIZE];
    for (size_t i = 0; i < n; i++) {
        const hsep_variable *variable = hsep_table_row(context, vr[i]);
        if (variable->causality != HSEP_INPUT && variable->causality != HSEP_PARAMETER) {
            return hsep_message_add(
                message, "%s: %s is %s and cannot be set", call, hsep_table_name(context, vr[i], name),
                values_causalities[variable->causality]);
        }
        if (variable->causality == HSEP_PARAMETER && !variable->tunable &&
            instance->experiment.phase == HSEP_STEPPING) {
            return hsep_message_add(
                message, "%s: %s is a fixed parameter and cannot be set after the initialization; call %s first", call,
                hsep_table_name(context, vr[i], name), reset);
        }
    }
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_values_prepare(hsep_instance *instance, const char *call, const unsigned vr[], size_t n, char message[])
{
    char reason[HSEP_MESSAGE_SIZE] = "", name[HSEP_NAME_SIZE];
    if (instance->state != NULL) {
        return HSEP_OK;
    }
    if (hsep_model_check_start(instance->values, reason) == HSEP_OK) {
        hsep_model_start_values(&instance->context, instance->values);
        return HSEP_OK;
    }
    for (size_t i = 0; i < n; i++) {
        const hsep_variable *variable = hsep_table_row(&instance->context, vr[i]);
        if (variable->causality == HSEP_OUTPUT || variable->causality == HSEP_LOCAL) {
            return hsep_message_add(
                message, "%s: %s is not known yet: %s", call, hsep_table_name(&instance->context, vr[i], name), reason);
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

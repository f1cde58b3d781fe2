#include "hsep_calls.h"

#include "hsep_check.h"
#include "hsep_windows.h"

#include <limits.h>

static const char *const values_causalities[] = {
    "an input", "an output", "a parameter", "a calculated variable", "the independent variable"};

HSEP_API hsep_status hsep_values_check(const hsep_instance *instance, const hsep_access *access)
{
    const hsep_context *context = &instance->context;
    const hsep_fmi_names *names = instance->names;
    const size_t n = access->n_references, n_variables = names->n_variables(context);
    char name[HSEP_NAME_SIZE];
    size_t n_values = 0;
    if (n > 0 && (access->references == NULL || access->values == NULL)) {
        return hsep_refuse(
            instance, "%s: %s is NULL, but %s is %lu", access->call,
            access->references == NULL ? names->references : names->values, names->n_references, (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        const unsigned reference = access->references[i];
        if (reference >= n_variables) {
            return hsep_refuse(
                instance, "%s: value reference must be 0 ... %lu, got %u", access->call, (unsigned long)n_variables - 1,
                reference);
        }
        const hsep_found found = names->find(context, reference);
        const char *type = names->types[found.kind];
        if (strcmp(type, access->type) != 0) {
            return hsep_refuse(
                instance, "%s: %s (value reference %u) is of type %s, not %s", access->call,
                names->name(context, reference, name), reference, type, access->type);
        }
        const hsep_causality causality = found.row->causality;
        if (access->sets && causality != HSEP_INPUT && causality != HSEP_PARAMETER) {
            return hsep_refuse(
                instance, "%s: %s is %s and cannot be set", access->call, names->name(context, reference, name),
                values_causalities[causality]);
        }
        if (access->sets && causality == HSEP_PARAMETER && !found.row->tunable &&
            instance->experiment.phase == HSEP_STEPPING) {
            return hsep_refuse(
                instance, "%s: %s is a fixed parameter and cannot be set after the initialization; call %s first",
                access->call, names->name(context, reference, name), names->reset);
        }
        n_values += found.count;
    }
    if (n_values != access->n_values) {
        return hsep_refuse(
            instance, "%s: %s must be %lu, the number of values of all variables, got %lu", access->call,
            names->n_values, (unsigned long)n_values, (unsigned long)access->n_values);
    }
    return HSEP_OK;
}

/* Calculate what is read: windows, and what follows from the start values before the initialization has ended. Refused
 * if one of the variables is calculated from a start value that is no position. */
static hsep_status values_prepare(hsep_instance *instance, const hsep_access *access)
{
    const hsep_fmi_names *names = instance->names;
    char reason[HSEP_MESSAGE_SIZE] = "", name[HSEP_NAME_SIZE];
    if (instance->state != NULL) {
#if HSEP_N_WINDOWS > 0 /* nothing else is local */
        for (size_t i = 0; i < access->n_references; i++) {
            if (names->find(&instance->context, access->references[i]).row->causality == HSEP_LOCAL) {
                hsep_model_show_windows(&instance->context, instance->state, instance->values);
                break;
            }
        }
#endif
        return HSEP_OK;
    }
    if (hsep_model_check_start(&instance->context, instance->values, reason) == HSEP_OK) {
        hsep_model_start_values(&instance->context, instance->values);
        return HSEP_OK;
    }
    for (size_t i = 0; i < access->n_references; i++) {
        const unsigned reference = access->references[i];
        const hsep_variable *variable = names->find(&instance->context, reference).row;
        if (variable->causality == HSEP_OUTPUT || variable->causality == HSEP_LOCAL) {
            return hsep_refuse(
                instance, "%s: %s is not known yet: %s", access->call, names->name(&instance->context, reference, name),
                reason);
        }
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_access(
    hsep_instance *instance, const hsep_call *call, const unsigned references[], size_t n, const void *values,
    size_t n_values)
{
    const char *verb = call->name + strlen("fmi2");
    const hsep_access access = {call->name, verb + strlen("Get"), verb[0] == 'S', references, n, values, n_values};
    if (hsep_values_check(instance, &access) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    return access.sets ? HSEP_OK : values_prepare(instance, &access);
}

HSEP_API hsep_status
hsep_call_tune(const hsep_instance *instance, const hsep_call *call, unsigned reference, double value)
{
    const hsep_context *context = &instance->context;
    char message[HSEP_MESSAGE_SIZE] = "";
    const hsep_found found = instance->names->find(context, reference);
    if ((instance->experiment.phase == HSEP_STEPPING || found.kind == HSEP_COUNT) &&
        found.row->causality == HSEP_PARAMETER && !hsep_check_parameter(context, reference, value, message)) {
        return hsep_refuse(instance, "%s: %s", call->name, message);
    }
    return HSEP_OK;
}

HSEP_API const double *hsep_values_source(const hsep_instance *instance, unsigned reference, size_t *count)
{
    const hsep_found found = instance->names->find(&instance->context, reference);
    *count = found.count;
    return found.row->causality == HSEP_INDEPENDENT ? &instance->experiment.time : &instance->values[found.place];
}

HSEP_API int hsep_values_integer(double number)
{
    if (!(number > (double)INT_MIN)) {
        return INT_MIN;
    }
    return number < (double)INT_MAX ? (int)number : INT_MAX;
}

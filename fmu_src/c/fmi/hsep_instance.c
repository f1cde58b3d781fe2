#include "hsep_instance.h"

#include "hsep_check.h"

HSEP_API void *hsep_new(const hsep_instance *instance, size_t size)
{
    void *block = instance->allocate(1, size);
    return block == NULL ? NULL : memset(block, 0, size);
}

HSEP_API void hsep_delete(const hsep_instance *instance, void *block)
{
    if (block != NULL) {
        instance->release(block);
    }
}

HSEP_API void hsep_instance_drop_state(hsep_instance *instance)
{
    hsep_delete(instance, instance->state);
    instance->state = NULL;
    instance->state_size = 0;
}

HSEP_API size_t hsep_instance_n_values(const hsep_instance *instance)
{
    return instance->context.n_variables + HSEP_N_INTERPOLATED;
}

HSEP_API hsep_status hsep_instance_resize(hsep_instance *instance, const char *call, size_t window, char message[])
{
    hsep_context *context = &instance->context;
    const size_t before = hsep_table_n_starts(context);
    const size_t after = HSEP_N_WINDOWS * window + HSEP_N_INTERPOLATED;
    if (window > instance->room) {
        double *values = hsep_new(instance, (before + after) * sizeof(double));
        if (values == NULL) {
            return hsep_message_add(message, "%s: no memory for %lu values", call, (unsigned long)(before + after));
        }
        memcpy(values, instance->values, before * sizeof(double));
        hsep_delete(instance, instance->values);
        instance->values = values;
        instance->room = window;
    }
    memset(instance->values + before, 0, after * sizeof(double));
    instance->values[HSEP_VR_LENGTH] = (double)window;
    context->n_variables = before + HSEP_N_WINDOWS * window;
    context->window = window;
    return HSEP_OK;
}

HSEP_API void hsep_instance_reset(hsep_instance *instance)
{
    hsep_context *context = &instance->context;
    hsep_instance_drop_state(instance);
    if (context->window > 0) { /* never more than there is room for */
        (void)hsep_instance_resize(instance, "", (size_t)context->starts[HSEP_VR_LENGTH], NULL);
    }
    memset(instance->values, 0, hsep_instance_n_values(instance) * sizeof(double));
    memcpy(instance->values, context->starts, hsep_table_n_starts(context) * sizeof(double));
    hsep_model_start_values(context, instance->values);
    instance->experiment = (hsep_experiment){.phase = HSEP_INSTANTIATED};
}

HSEP_API hsep_status hsep_instance_initialise(hsep_instance *instance, const char *call, char message[])
{
    size_t size = 0;
    if (hsep_model_size(&instance->context, instance->values, &size, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    instance->state = hsep_new(instance, size);
    if (instance->state == NULL) {
        return hsep_message_add(message, "%s: no memory for a state of %lu bytes", call, (unsigned long)size);
    }
    instance->state_size = size;
    const hsep_status status = hsep_model_initialise(
        &instance->context, instance->state, size, instance->values, instance->experiment.start_time, message);
    if (status == HSEP_REFUSED) {
        hsep_instance_drop_state(instance);
        return HSEP_REFUSED;
    }
    instance->experiment.phase = HSEP_STEPPING;
    return status;
}

HSEP_API void hsep_instance_free(hsep_instance *instance)
{
    if (instance == NULL) {
        return;
    }
    hsep_instance_drop_state(instance);
    hsep_delete(instance, instance->values);
    hsep_delete(instance, instance->table);
    hsep_delete(instance, instance->weights);
    hsep_delete(instance, instance->resources);
    hsep_delete(instance, instance->name);
    instance->release(instance);
}

#include "hsep_instance.h"

#include "hsep_check.h"
#include "hsep_table.h"
#include "hsep_table_file.h"
#include "hsep_uri.h"

#include <string.h>

#ifdef _WIN32
enum { INSTANCE_WINDOWS = 1 };
#else
enum { INSTANCE_WINDOWS = 0 };
#endif

/* Share of a step by which rounding may end the last step before the stop time. */
static const double instance_stop_tolerance = 1e-6;

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

/* Take the folder of a URI or path, or NULL. HSEP_WARNED: it is none. */
static hsep_status instance_folder(hsep_instance *instance, const char *uri, char message[])
{
    const hsep_words *words = instance->words;
    if (uri == NULL) {
        return HSEP_OK;
    }
    instance->resources = hsep_new(instance, HSEP_FOLDER_SIZE(strlen(uri)));
    if (instance->resources == NULL) {
        return hsep_message_add(message, "%s: no memory for the path of the resources", words->instantiate);
    }
    if (hsep_uri_folder(uri, INSTANCE_WINDOWS, instance->resources)) {
        return HSEP_OK;
    }
    hsep_message_add(
        message, "%s: %s must be %s on this machine, got %.300s; it is not used", words->instantiate, words->location,
        words->location_form, uri);
    hsep_delete(instance, instance->resources);
    instance->resources = NULL;
    return HSEP_WARNED;
}

/* Take the table from the resources if the header has none. */
static hsep_status instance_table(hsep_instance *instance, char message[])
{
#ifdef HSEP_TABLE_IN_RESOURCES
    return hsep_table_file_open(instance, message);
#else
    (void)message;
    instance->context = hsep_table;
    return HSEP_OK;
#endif
}

HSEP_API hsep_status
hsep_instance_open(hsep_instance *instance, const char *name, const char *resources, char message[])
{
    const char *call = instance->words->instantiate;
    instance->name = hsep_new(instance, strlen(name) + 1);
    if (instance->name == NULL) {
        return hsep_message_add(message, "%s: no memory for the instance's name", call);
    }
    (void)strcpy(instance->name, name);
    const hsep_status folder = instance_folder(instance, resources, message);
    if (folder == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    const hsep_status table = instance_table(instance, message);
    if (table == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    instance->context.resources = instance->resources;
    instance->values = hsep_new(instance, hsep_instance_n_values(instance) * sizeof(double));
    if (instance->values == NULL) {
        return hsep_message_add(
            message, "%s: no memory for %lu values", call, (unsigned long)hsep_instance_n_values(instance));
    }
    return table == HSEP_WARNED ? table : folder;
}

HSEP_API size_t hsep_instance_n_values(const hsep_instance *instance)
{
    return instance->context.n_variables + HSEP_N_INTERPOLATED;
}

HSEP_API void hsep_instance_reset(hsep_instance *instance)
{
    hsep_instance_drop_state(instance);
    memset(instance->values, 0, hsep_instance_n_values(instance) * sizeof(double));
    for (size_t i = 0; i < instance->context.n_variables; i++) {
        instance->values[i] = hsep_table_start(&instance->context, i);
    }
    hsep_model_start_values(&instance->context, instance->values);
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
    if (hsep_model_initialise(
            &instance->context, instance->state, size, instance->values, instance->experiment.start_time, message) !=
        HSEP_OK) {
        hsep_instance_drop_state(instance);
        return HSEP_REFUSED;
    }
    instance->experiment.phase = HSEP_STEPPING;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_instance_step(hsep_instance *instance, const char *call, double t, double h, char message[])
{
    if (instance->experiment.has_stop_time && t >= instance->experiment.stop_time - instance_stop_tolerance * h) {
        return hsep_message_add(
            message, "%s: a step must begin before the stop time %.9g s, got one from %.9g s", call,
            instance->experiment.stop_time, t);
    }
    const hsep_status status = hsep_model_step(&instance->context, instance->state, instance->values, t, h, message);
    if (status != HSEP_REFUSED) {
        memset(instance->values + instance->context.n_variables, 0, HSEP_N_INTERPOLATED * sizeof(double));
        instance->experiment.time = t + h;
    }
    return status;
}

HSEP_API void hsep_instance_free(hsep_instance *instance)
{
    hsep_instance_drop_state(instance);
    hsep_delete(instance, instance->values);
    hsep_delete(instance, instance->table);
    hsep_delete(instance, instance->resources);
    hsep_delete(instance, instance->name);
    instance->release(instance);
}

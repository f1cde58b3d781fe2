/* The life of an instance: memory, instantiation, reset, end. */
#include "hsep_fmi2_instance.h"

#include <stdlib.h>
#include <string.h>

#include "hsep_uri.h"

#ifdef _WIN32
enum { HSEP_WINDOWS = 1 };
#else
enum { HSEP_WINDOWS = 0 };
#endif

HSEP_API void *hsep_new(const hsep_instance *instance, size_t size)
{
    void *block = instance->allocate(1, size);
    return (block == NULL) ? NULL : memset(block, 0, size);
}

HSEP_API void hsep_delete(const hsep_instance *instance, void *block)
{
    if (block != NULL) {
        instance->release(block);
    }
}

HSEP_API void hsep_drop_state(hsep_instance *instance)
{
    hsep_delete(instance, instance->state);
    instance->state = NULL;
    instance->state_size = 0;
}

/* As after fmi2Instantiate: start values, no experiment, no state. */
static void hsep_begin_again(hsep_instance *instance)
{
    hsep_drop_state(instance);
    memset(instance->values, 0, sizeof instance->values);
    for (size_t i = 0; i < HSEP_N_VARIABLES; ++i) {
        instance->values[i] = hsep_variables[i].start;
    }
    hsep_model_start_values(&instance->context, instance->values);
    instance->has_stop_time = 0;
    instance->start_time = 0.0;
    instance->stop_time = 0.0;
    instance->time = 0.0;
    instance->phase = HSEP_INSTANTIATED;
}

/* Keep name and resources; 0, with a message, if there is no memory for them. */
static int hsep_keep_texts(hsep_instance *instance, const char *name, const char *resources)
{
    instance->name = hsep_new(instance, strlen(name) + 1);
    if (resources != NULL) {
        instance->resources = hsep_new(instance, HSEP_FOLDER_SIZE(strlen(resources)));
    }
    if (instance->name == NULL || (resources != NULL && instance->resources == NULL)) {
        (void)hsep_refuse(instance, "fmi2Instantiate: no memory for the instance's name and resources");
        return 0;
    }
    (void)strcpy(instance->name, name);
    if (resources != NULL && !hsep_uri_folder(resources, HSEP_WINDOWS, instance->resources)) {
        hsep_log(
            instance, HSEP_LOG_WARNING,
            "fmi2Instantiate: fmuResourceLocation must be a file: URI on this machine, got %.300s; it is not used",
            resources);
        hsep_delete(instance, instance->resources);
        instance->resources = NULL;
    }
    return 1;
}

/* Say why the arguments of fmi2Instantiate cannot be used; 1 if they can. */
static int hsep_check_arguments(hsep_instance *instance, fmi2String name, fmi2Type type, fmi2String guid)
{
    if (name == NULL || name[0] == '\0') {
        (void)hsep_refuse(instance, "fmi2Instantiate: instanceName must not be empty");
    } else if (type != fmi2CoSimulation) {
        (void)hsep_refuse(instance, "fmi2Instantiate: fmuType must be fmi2CoSimulation, got %d", (int)type);
    } else if (guid == NULL || strcmp(guid, HSEP_GUID) != 0) {
        (void)hsep_refuse(
            instance, "fmi2Instantiate: fmuGUID must be %s as in modelDescription.xml, got %.100s", HSEP_GUID,
            (guid == NULL) ? "NULL" : guid);
    } else {
        return 1;
    }
    return 0;
}

fmi2Component fmi2Instantiate(
    fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const int own_memory = functions == NULL || functions->allocateMemory == NULL || functions->freeMemory == NULL;
    const hsep_allocate allocate = own_memory ? calloc : functions->allocateMemory;
    const fmi2CallbackLogger logger = (functions == NULL) ? NULL : functions->logger;
    hsep_instance *instance = allocate(1, sizeof *instance);
    (void)visible;
    if (instance == NULL) {
        if (logger != NULL) {
            logger(
                functions->componentEnvironment, HSEP_MODEL_IDENTIFIER, fmi2Error, "logStatusError",
                "fmi2Instantiate: no memory for an instance of %lu bytes", (unsigned long)sizeof *instance);
        }
        return NULL;
    }
    memset(instance, 0, sizeof *instance);
    instance->allocate = allocate;
    instance->release = own_memory ? free : functions->freeMemory;
    instance->logger = logger;
    instance->environment = (functions == NULL) ? NULL : functions->componentEnvironment;
    instance->categories = HSEP_LOG_WARNING | HSEP_LOG_DISCARD | HSEP_LOG_ERROR | HSEP_LOG_FATAL;
    if (loggingOn) {
        instance->categories |= HSEP_LOG_ALL;
    }
    if (!hsep_check_arguments(instance, instanceName, fmuType, fmuGUID) ||
        !hsep_keep_texts(instance, instanceName, fmuResourceLocation)) {
        fmi2FreeInstance(instance);
        return NULL;
    }
    instance->context.variables = hsep_variables;
    instance->context.n_variables = HSEP_N_VARIABLES;
    instance->context.resources = instance->resources;
    hsep_begin_again(instance);
    return instance;
}

void fmi2FreeInstance(fmi2Component c)
{
    hsep_instance *instance = c;
    if (instance == NULL) {
        return;
    }
    hsep_drop_state(instance);
    hsep_delete(instance, instance->resources);
    hsep_delete(instance, instance->name);
    instance->release(instance);
}

fmi2Status fmi2Reset(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_RESET);
    if (instance == NULL) {
        return fmi2Error;
    }
    hsep_begin_again(instance);
    return fmi2OK;
}

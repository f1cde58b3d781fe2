/* Instantiation, reset and release of an instance. */
#include "hsep_fmi2_instance.h"

#include "hsep_check.h"

#include <stdlib.h>
#include <string.h>

/* Check the arguments of fmi2Instantiate and take the table; why not is logged. */
static hsep_status hsep_open(
    hsep_instance *instance, fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources)
{
    static const char call[] = "fmi2Instantiate";
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_status status = HSEP_REFUSED;
    if (name == NULL || name[0] == '\0') {
        (void)hsep_message_add(message, "%s: instanceName must not be empty", call);
    } else if (type != fmi2CoSimulation) {
        (void)hsep_message_add(message, "%s: fmuType must be fmi2CoSimulation, got %d", call, (int)type);
    } else {
        status = hsep_instance_open(instance, call, name, resources, message);
    }
    if (status != HSEP_REFUSED && (guid == NULL || strcmp(guid, instance->context.guid) != 0)) {
        status = hsep_message_add(
            message, "%s: fmuGUID must be %s as in modelDescription.xml, got %.100s", call, instance->context.guid,
            (guid == NULL) ? "NULL" : guid);
    }
    if (status != HSEP_OK) {
        hsep_log(instance, status == HSEP_WARNED ? HSEP_LOG_WARNING : HSEP_LOG_ERROR, "%s", message);
    }
    return status;
}

fmi2Component fmi2Instantiate(
    fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const int own_memory = functions == NULL || functions->allocateMemory == NULL || functions->freeMemory == NULL;
    const hsep_allocate allocate = own_memory ? calloc : functions->allocateMemory;
    const fmi2CallbackLogger logger = (functions == NULL) ? NULL : functions->logger;
    hsep_component *component = allocate(1, sizeof *component);
    (void)visible;
    if (component == NULL) {
        if (logger != NULL) {
            logger(
                functions->componentEnvironment, HSEP_MODEL_NAME, fmi2Error, "logStatusError",
                "fmi2Instantiate: no memory for an instance of %lu bytes", (unsigned long)sizeof *component);
        }
        return NULL;
    }
    memset(component, 0, sizeof *component);
    component->logger = logger;
    component->environment = (functions == NULL) ? NULL : functions->componentEnvironment;
    component->categories = HSEP_LOG_WARNING | HSEP_LOG_DISCARD | HSEP_LOG_ERROR | HSEP_LOG_FATAL;
    if (loggingOn) {
        component->categories |= HSEP_LOG_ALL;
    }
    hsep_instance *instance = &component->instance;
    instance->allocate = allocate;
    instance->release = own_memory ? free : functions->freeMemory;
    if (hsep_open(instance, instanceName, fmuType, fmuGUID, fmuResourceLocation) == HSEP_REFUSED) {
        hsep_instance_free(instance);
        return NULL;
    }
    hsep_instance_reset(instance);
    return component;
}

void fmi2FreeInstance(fmi2Component c)
{
    hsep_component *component = c;
    if (component != NULL) {
        hsep_instance_free(&component->instance);
    }
}

fmi2Status fmi2Reset(fmi2Component c)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_RESET);
    if (instance == NULL) {
        return fmi2Error;
    }
    hsep_instance_reset(instance);
    return fmi2OK;
}

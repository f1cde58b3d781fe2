#include "hsep_component.h"

#include "hsep_check.h"
#include "hsep_opening.h"
#include "hsep_text.h"

#include <stdarg.h>
#include <string.h>

enum { COMPONENT_N_CATEGORIES = 5, COMPONENT_LOG_EVERYTHING = 31 };

static const char *const component_categories[COMPONENT_N_CATEGORIES] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"};
static const int component_status[COMPONENT_N_CATEGORIES] = {1, 2, 3, 4, 0};

/* The place of the only bit that is set. */
static int component_place(unsigned bit)
{
    int place = 0;
    while ((1U << place) != bit) {
        place++;
    }
    return place;
}

static void component_log(const hsep_instance *instance, hsep_category category, const char *format, va_list arguments)
{
    char text[2 * HSEP_MESSAGE_SIZE];
    const int place = component_place((unsigned)category);
    const hsep_component *component = (const hsep_component *)instance;
    if (component->logger == NULL || (component->categories & (unsigned)category) == 0) {
        return;
    }
    (void)hsep_text_list(text, sizeof text, format, arguments);
    component->hand(component, component_status[place], component_categories[place], text);
}

HSEP_API void hsep_log(hsep_instance *instance, hsep_category category, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    component_log(instance, category, format, arguments);
    va_end(arguments);
}

HSEP_API hsep_status hsep_refuse(hsep_instance *instance, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    component_log(instance, HSEP_LOG_ERROR, format, arguments);
    va_end(arguments);
    return HSEP_REFUSED;
}

HSEP_API hsep_instance *hsep_begin(void *component, const hsep_call *call)
{
    hsep_instance *instance = component;
    char legal[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL || (call->legal & (unsigned)instance->experiment.phase) != 0) {
        return instance;
    }
    const char *const *phases = instance->names->phases;
    for (int place = 0; place < HSEP_N_PHASES; place++) {
        if ((call->legal & (1U << place)) != 0) {
            (void)strcat(strcat(legal, (legal[0] == '\0') ? "; it is allowed in: " : ", "), phases[place]);
        }
    }
    (void)hsep_refuse(
        instance, "%s is not allowed in the state %s%s", call->name,
        phases[component_place(instance->experiment.phase)], legal);
    return NULL;
}

/* Check name and token and take the table; why not is logged. */
static hsep_status component_open(hsep_instance *instance, const char *name, const char *token, const char *resources)
{
    const hsep_fmi_names *names = instance->names;
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_status status = HSEP_REFUSED;
    if (name == NULL || name[0] == '\0') {
        (void)hsep_message_add(message, "%s: instanceName must not be empty", names->instantiate);
    } else {
        status = hsep_open(instance, name, resources, message);
    }
    if (status != HSEP_REFUSED && (token == NULL || strcmp(token, instance->context.guid) != 0)) {
        status = hsep_message_add(
            message, "%s: %s must be %s as in modelDescription.xml, got %.100s", names->instantiate, names->token,
            instance->context.guid, (token == NULL) ? "NULL" : token);
    }
    if (status != HSEP_OK) {
        hsep_log(instance, status == HSEP_WARNED ? HSEP_LOG_WARNING : HSEP_LOG_ERROR, "%s", message);
    }
    return status;
}

HSEP_API hsep_component *hsep_component_new(
    const hsep_component *filled, const char *name, const char *token, const char *resources, int logging_on)
{
    hsep_component *component = hsep_new(&filled->instance, sizeof *component);
    if (component == NULL) {
        char text[HSEP_MESSAGE_SIZE];
        (void)hsep_text(
            text, sizeof text, "%s: no memory for an instance of %lu bytes", filled->instance.names->instantiate,
            (unsigned long)sizeof *component);
        if (filled->logger != NULL) {
            filled->hand(filled, component_status[2], component_categories[2], text);
        }
        return NULL;
    }
    *component = *filled;
    component->categories = COMPONENT_LOG_EVERYTHING;
    if (!logging_on) {
        component->categories &= ~(unsigned)HSEP_LOG_ALL;
    }
    if (component_open(&component->instance, name, token, resources) == HSEP_REFUSED) {
        hsep_instance_free(&component->instance);
        return NULL;
    }
    hsep_instance_reset(&component->instance);
    return component;
}

HSEP_API hsep_status hsep_call_logging(void *handle, const hsep_call *call, int on, size_t n, const char *const names[])
{
    hsep_component *component = handle;
    unsigned named = 0;
    if (hsep_begin(handle, call) == NULL) {
        return HSEP_REFUSED;
    }
    if (n > 0 && names == NULL) {
        return hsep_refuse(
            &component->instance, "%s: categories is NULL, but nCategories is %lu", call->name, (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        for (unsigned place = 0; names[i] != NULL && place < COMPONENT_N_CATEGORIES; place++) {
            if (strcmp(names[i], component_categories[place]) == 0) {
                named |= 1U << place;
            }
        }
    }
    if ((named & HSEP_LOG_ALL) != 0) {
        named = COMPONENT_LOG_EVERYTHING;
    }
    if (n == 0) {
        component->categories = on ? COMPONENT_LOG_EVERYTHING : COMPONENT_LOG_EVERYTHING & ~(unsigned)HSEP_LOG_ALL;
    } else if (named != 0) {
        component->categories = on ? named : component->categories & ~named;
    }
    return HSEP_OK;
}

/* Legal calls, messages and log categories. */
#include "hsep_fmi2_instance.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { HSEP_N_CATEGORIES = 5, HSEP_LOG_EVERYTHING = 31 };

static const char *const hsep_category_names[HSEP_N_CATEGORIES] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"};
static const fmi2Status hsep_category_status[HSEP_N_CATEGORIES] = {
    fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2OK};

/* Names of the states, one bit each. */
static const char *const hsep_phase_names[] = {
    "instantiated", "Initialization Mode", "stepping (after fmi2ExitInitializationMode)", "terminated"};

/* The place of the only bit that is set. */
static int hsep_place(unsigned bit)
{
    int place = 0;
    while ((1U << place) != bit) {
        place++;
    }
    return place;
}

static void hsep_log_list(const hsep_instance *instance, hsep_category category, const char *format, va_list arguments)
{
    char text[2 * HSEP_MESSAGE_SIZE];
    char escaped[4 * HSEP_MESSAGE_SIZE];
    const int place = hsep_place((unsigned)category);
    size_t n = 0;
    const hsep_component *component = (const hsep_component *)instance;
    if (component->logger == NULL || (component->categories & (unsigned)category) == 0) {
        return;
    }
    (void)vsnprintf(text, sizeof text, format, arguments);
    /* The logger reads its message as printf does: a percent sign in ours stands for itself. */
    for (const char *c = text; *c != '\0'; c++) {
        if (*c == '%') {
            escaped[n++] = '%';
        }
        escaped[n++] = *c;
    }
    escaped[n] = '\0';
    component->logger(
        component->environment, (instance->name == NULL) ? HSEP_MODEL_NAME : instance->name,
        hsep_category_status[place], hsep_category_names[place], escaped);
}

HSEP_API void hsep_log(hsep_instance *instance, hsep_category category, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    hsep_log_list(instance, category, format, arguments);
    va_end(arguments);
}

HSEP_API fmi2Status hsep_refuse(hsep_instance *instance, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    hsep_log_list(instance, HSEP_LOG_ERROR, format, arguments);
    va_end(arguments);
    return fmi2Error;
}

HSEP_API hsep_instance *hsep_begin(fmi2Component component, hsep_call call)
{
    hsep_instance *instance = component;
    const hsep_call_row *row = &hsep_calls[call];
    char legal[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL || (row->legal & (unsigned)instance->experiment.phase) != 0) {
        return instance;
    }
    for (unsigned phase = HSEP_INSTANTIATED; phase <= HSEP_TERMINATED; phase *= 2) {
        if ((row->legal & phase) != 0) {
            (void)strcat(
                strcat(legal, (legal[0] == '\0') ? "; it is allowed in: " : ", "), hsep_phase_names[hsep_place(phase)]);
        }
    }
    (void)hsep_refuse(
        instance, "%s is not allowed in the state %s%s", row->name,
        hsep_phase_names[hsep_place(instance->experiment.phase)], legal);
    return NULL;
}

/* With names, these categories alone are switched on, or these off; a name that is not ours changes nothing. Without
 * names, on means everything and off the state after instantiation without loggingOn: warnings and errors. */
fmi2Status fmi2SetDebugLogging(
    fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_SET_DEBUG_LOGGING);
    hsep_component *component = c;
    unsigned named = 0;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (nCategories > 0 && categories == NULL) {
        return hsep_refuse(
            instance, "fmi2SetDebugLogging: categories is NULL, but nCategories is %lu", (unsigned long)nCategories);
    }
    for (size_t i = 0; i < nCategories; i++) {
        for (unsigned place = 0; categories[i] != NULL && place < HSEP_N_CATEGORIES; place++) {
            if (strcmp(categories[i], hsep_category_names[place]) == 0) {
                named |= 1U << place;
            }
        }
    }
    if ((named & HSEP_LOG_ALL) != 0) {
        named = HSEP_LOG_EVERYTHING;
    }
    if (nCategories == 0) {
        component->categories = loggingOn ? HSEP_LOG_EVERYTHING : HSEP_LOG_EVERYTHING & ~(unsigned)HSEP_LOG_ALL;
    } else if (named != 0) {
        component->categories = loggingOn ? named : component->categories & ~named;
    }
    return fmi2OK;
}

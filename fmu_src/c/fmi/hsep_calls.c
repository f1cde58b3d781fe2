#include "hsep_calls.h"

#include "hsep_check.h"
#include "hsep_text.h"

#include <stdarg.h>

enum { CALLS_N_CATEGORIES = 5, CALLS_LOG_EVERYTHING = 31 };

static const char *const calls_categories[CALLS_N_CATEGORIES] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"};
static const int calls_status[CALLS_N_CATEGORIES] = {1, 2, 3, 4, 0};

/* Share of a step by which rounding may end the last step before the stop time. */
static const double calls_stop_tolerance = 1e-6;

/* The place of the only bit that is set. */
static int calls_place(unsigned bit)
{
    int place = 0;
    while ((1U << place) != bit) {
        place++;
    }
    return place;
}

HSEP_API void hsep_log(const hsep_instance *instance, hsep_category category, const char *format, ...)
{
    char text[2 * HSEP_MESSAGE_SIZE];
    const int place = calls_place((unsigned)category);
    if (instance->logger == NULL || (instance->categories & (unsigned)category) == 0) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    (void)hsep_text_list(text, sizeof text, format, arguments);
    va_end(arguments);
    instance->hand(instance, calls_status[place], calls_categories[place], text);
}

HSEP_API hsep_instance *hsep_instance_for(void *handle, const hsep_call *call)
{
    hsep_instance *instance = handle;
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
        instance, "%s is not allowed in the state %s%s", call->name, phases[calls_place(instance->experiment.phase)],
        legal);
    return NULL;
}

HSEP_API hsep_instance *hsep_call_instantiate(
    const hsep_instance *filled, const char *name, const char *token, const char *resources, int logging_on)
{
    const hsep_fmi_names *names = filled->names;
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_status status = HSEP_REFUSED;
    hsep_instance *instance = hsep_new(filled, sizeof *instance);
    if (instance == NULL) {
        (void)hsep_refuse(
            filled, "%s: no memory for an instance of %lu bytes", names->instantiate, (unsigned long)sizeof *instance);
        return NULL;
    }
    *instance = *filled;
    instance->categories = logging_on ? CALLS_LOG_EVERYTHING : CALLS_LOG_EVERYTHING & ~(unsigned)HSEP_LOG_ALL;
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
    if (status == HSEP_REFUSED) {
        hsep_instance_free(instance);
        return NULL;
    }
    hsep_instance_reset(instance);
    return instance;
}

HSEP_API hsep_status
hsep_call_logging(hsep_instance *instance, const hsep_call *call, int on, size_t n, const char *const names[])
{
    unsigned named = 0;
    if (n > 0 && names == NULL) {
        return hsep_refuse(instance, "%s: categories is NULL, but nCategories is %lu", call->name, (unsigned long)n);
    }
    for (size_t i = 0; i < n; i++) {
        for (unsigned place = 0; names[i] != NULL && place < CALLS_N_CATEGORIES; place++) {
            if (strcmp(names[i], calls_categories[place]) == 0) {
                named |= 1U << place;
            }
        }
    }
    if ((named & HSEP_LOG_ALL) != 0) {
        named = CALLS_LOG_EVERYTHING;
    }
    if (n == 0) {
        instance->categories = on ? CALLS_LOG_EVERYTHING : CALLS_LOG_EVERYTHING & ~(unsigned)HSEP_LOG_ALL;
    } else if (named != 0) {
        instance->categories = on ? named : instance->categories & ~named;
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_experiment(
    hsep_instance *instance, const hsep_call *call, double start_time, int has_stop_time, double stop_time)
{
    if (!isfinite(start_time)) {
        return hsep_refuse(instance, "%s: startTime must be finite, got %g s", call->name, start_time);
    }
    if (has_stop_time && !(stop_time >= start_time)) {
        return hsep_refuse(
            instance, "%s: stopTime must be >= startTime = %g s, got %g s", call->name, start_time, stop_time);
    }
    instance->experiment = (hsep_experiment){
        .phase = instance->experiment.phase,
        .has_stop_time = has_stop_time ? 1U : 0U,
        .start_time = start_time,
        .stop_time = has_stop_time ? stop_time : 0.0,
        .time = start_time};
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_phase(hsep_instance *instance, hsep_phase phase)
{
    instance->experiment.phase = phase;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_initialise(hsep_instance *instance, const hsep_call *call)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    const hsep_status status = hsep_instance_initialise(instance, call->name, message);
    if (status == HSEP_REFUSED) {
        return hsep_refuse(instance, "%s", message);
    }
    if (status == HSEP_WARNED) {
        hsep_log(instance, HSEP_LOG_WARNING, "%s: %s", call->name, message);
    }
    hsep_log(
        instance, HSEP_LOG_ALL, "initialized at %g s with a state of %lu bytes", instance->experiment.start_time,
        (unsigned long)instance->state_size);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_step(hsep_instance *instance, const hsep_call *call, double t, double h)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance->experiment.has_stop_time && t >= instance->experiment.stop_time - calls_stop_tolerance * h) {
        return hsep_refuse(
            instance, "%s: a step must begin before the stop time %.9g s, got one from %.9g s", call->name,
            instance->experiment.stop_time, t);
    }
    const hsep_status status = hsep_model_step(&instance->context, instance->state, instance->values, t, h, message);
    if (status == HSEP_REFUSED) {
        return hsep_refuse(instance, "%s", message);
    }
    memset(instance->values + instance->context.n_variables, 0, HSEP_N_INTERPOLATED * sizeof(double));
    instance->experiment.time = t + h;
    if (((unsigned)status & ~instance->warned) != 0) {
        instance->warned |= (unsigned)status;
        hsep_log(instance, HSEP_LOG_WARNING, "%s: %s", call->name, message);
    }
    return HSEP_OK;
}

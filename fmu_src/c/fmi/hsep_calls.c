#include "hsep_calls.h"

#include "hsep_check.h"
#include "hsep_saved.h"
#include "hsep_table.h"

#include <math.h>

HSEP_API hsep_status
hsep_call_experiment(void *component, const hsep_call *call, double start_time, int has_stop_time, double stop_time)
{
    hsep_instance *instance = hsep_begin(component, call);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
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

HSEP_API hsep_status hsep_call_phase(void *component, const hsep_call *call, hsep_phase phase)
{
    hsep_instance *instance = hsep_begin(component, call);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    instance->experiment.phase = phase;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_initialise(void *component, const hsep_call *call)
{
    hsep_instance *instance = hsep_begin(component, call);
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (hsep_instance_initialise(instance, call->name, message) != HSEP_OK) {
        return hsep_refuse(instance, "%s", message);
    }
    hsep_log(
        instance, HSEP_LOG_ALL, "initialized at %g s with a state of %lu bytes", instance->experiment.start_time,
        (unsigned long)instance->state_size);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_step(void *component, const hsep_call *call, double t, double h)
{
    hsep_instance *instance = hsep_begin(component, call);
    hsep_component *warning = component;
    char message[HSEP_MESSAGE_SIZE] = "";
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    const hsep_status status = hsep_instance_step(instance, call->name, t, h, message);
    if (status == HSEP_REFUSED) {
        return hsep_refuse(instance, "%s", message);
    }
    if (((unsigned)status & ~warning->warned) != 0) {
        warning->warned |= (unsigned)status;
        hsep_log(instance, HSEP_LOG_WARNING, "%s: %s", call->name, message);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_reset(void *component, const hsep_call *call)
{
    hsep_instance *instance = hsep_begin(component, call);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    hsep_instance_reset(instance);
    return HSEP_OK;
}

HSEP_API hsep_instance *hsep_call_access(
    void *component, const hsep_call *call, int sets, const char *type, const unsigned references[], size_t n,
    const void *values, size_t n_values)
{
    const hsep_access access = {call->name, type, references, n, values, n_values};
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_instance *instance = hsep_begin(component, call);
    if (instance == NULL) {
        return NULL;
    }
    hsep_status status = hsep_values_check(instance, &access, message);
    if (status == HSEP_OK) {
        status =
            sets ? hsep_values_check_set(instance, &access, message) : hsep_values_prepare(instance, &access, message);
    }
    if (status != HSEP_OK) {
        (void)hsep_refuse(instance, "%s", message);
        return NULL;
    }
    return instance;
}

HSEP_API hsep_instance *hsep_call_tune(hsep_instance *instance, const hsep_call *call, unsigned reference, double value)
{
    const hsep_context *context = &instance->context;
    char message[HSEP_MESSAGE_SIZE] = "";
    const hsep_found found = instance->names->find(context, reference);
    if ((instance->experiment.phase == HSEP_STEPPING || found.kind == HSEP_COUNT) &&
        found.row->causality == HSEP_PARAMETER && !hsep_check_parameter(context, reference, value, message)) {
        (void)hsep_refuse(instance, "%s: %s", call->name, message);
        return NULL;
    }
    return instance;
}

/* The instance if the call is legal and the handle is a saved state; otherwise NULL, with a message. */
static hsep_instance *calls_begin_saved(void *component, const hsep_call *call, const hsep_saved *state)
{
    hsep_instance *instance = hsep_begin(component, call);
    if (instance != NULL && state == NULL) {
        (void)hsep_refuse(instance, "%s: the state is NULL", call->name);
        return NULL;
    }
    if (instance != NULL && !hsep_is_saved(state)) {
        (void)hsep_refuse(instance, "%s: the state is none of this FMU", call->name);
        return NULL;
    }
    return instance;
}

/* The same where a place for a handle is given, which may hold none; its state goes to *saved. */
static hsep_instance *calls_begin_place(void *component, const hsep_call *call, void **place, hsep_saved **saved)
{
    *saved = (place != NULL) ? *place : NULL;
    return *saved != NULL ? calls_begin_saved(component, call, *saved) : hsep_begin(component, call);
}

HSEP_API hsep_status hsep_call_save(void *component, const hsep_call *call, void **state)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *saved;
    hsep_instance *instance = calls_begin_place(component, call, state, &saved);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (state == NULL) {
        return hsep_refuse(instance, "%s: the place of the state is NULL", call->name);
    }
    if (hsep_save(instance, &saved, message) != HSEP_OK) {
        return hsep_refuse(instance, "%s: %s", call->name, message);
    }
    *state = saved;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_restore(void *component, const hsep_call *call, void *state)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_instance *instance = calls_begin_saved(component, call, state);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (hsep_restore(instance, state, message) != HSEP_OK) {
        return hsep_refuse(instance, "%s: %s", call->name, message);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_free_state(void *component, const hsep_call *call, void **state)
{
    hsep_saved *saved;
    if (calls_begin_place(component, call, state, &saved) == NULL) {
        return HSEP_REFUSED;
    }
    if (saved != NULL) { /* the standard: freeing nothing is fine */
        hsep_free_saved(saved);
        *state = NULL;
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_state_size(void *component, const hsep_call *call, void *state, size_t *size)
{
    hsep_instance *instance = calls_begin_saved(component, call, state);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (size == NULL) {
        return hsep_refuse(instance, "%s: size is NULL", call->name);
    }
    *size = hsep_saved_size(state);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_serialise(void *component, const hsep_call *call, void *state, void *bytes, size_t size)
{
    hsep_instance *instance = calls_begin_saved(component, call, state);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (bytes == NULL || size < hsep_saved_size(state)) {
        return hsep_refuse(
            instance, "%s: serializedState must have room for %lu bytes, got %lu%s", call->name,
            (unsigned long)hsep_saved_size(state), (unsigned long)size, bytes == NULL ? " and NULL" : "");
    }
    hsep_serialise(state, bytes);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_call_deserialise(void *component, const hsep_call *call, const void *bytes, size_t size, void **state)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *saved;
    hsep_instance *instance = calls_begin_place(component, call, state, &saved);
    if (instance == NULL) {
        return HSEP_REFUSED;
    }
    if (bytes == NULL || state == NULL) {
        return hsep_refuse(
            instance, "%s: %s is NULL", call->name, bytes == NULL ? "serializedState" : "the place of the state");
    }
    if (hsep_deserialise(instance, bytes, size, &saved, message) != HSEP_OK) {
        return hsep_refuse(instance, "%s: %s", call->name, message);
    }
    *state = saved;
    return HSEP_OK;
}

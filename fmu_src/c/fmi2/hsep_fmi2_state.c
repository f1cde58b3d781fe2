/* Saving and restoring an instance. */
#include "hsep_fmi2_saved.h"

#include <string.h>

static hsep_header hsep_header_of(const hsep_instance *instance)
{
    hsep_header header;
    memset(&header, 0, sizeof header);
    memcpy(header.magic, HSEP_SAVED_MAGIC, sizeof header.magic);
    header.version = HSEP_SAVED_VERSION;
    header.byte_order = HSEP_BYTE_ORDER;
    memcpy(header.guid, HSEP_GUID, sizeof HSEP_GUID);
    header.size = HSEP_FIXED_SIZE + instance->state_size;
    header.phase = (uint32_t)instance->phase;
    header.has_stop_time = instance->has_stop_time ? 1U : 0U;
    header.start_time = instance->start_time;
    header.stop_time = instance->stop_time;
    header.time = instance->time;
    header.state_size = instance->state_size;
    return header;
}

HSEP_API hsep_saved *hsep_saved_of(hsep_instance *instance, hsep_call call, fmi2FMUstate state)
{
    hsep_saved *saved = state;
    if (saved == NULL) {
        (void)hsep_refuse(instance, "%s: FMUstate is NULL", hsep_calls[call].name);
    } else if (memcmp(saved->magic, HSEP_SAVED_MAGIC, sizeof saved->magic) != 0) {
        (void)hsep_refuse(instance, "%s: FMUstate is no state of this FMU", hsep_calls[call].name);
        saved = NULL;
    }
    return saved;
}

HSEP_API void hsep_free_saved(hsep_saved *saved)
{
    memset(saved->magic, 0, sizeof saved->magic);
    saved->release(saved);
}

HSEP_API hsep_saved *hsep_room(hsep_instance *instance, hsep_saved *saved, size_t size)
{
    if (saved != NULL && saved->capacity >= size) {
        return saved;
    }
    saved = hsep_new(instance, sizeof *saved + size);
    if (saved != NULL) {
        memcpy(saved->magic, HSEP_SAVED_MAGIC, sizeof saved->magic);
        saved->capacity = size;
        saved->release = instance->release;
    }
    return saved;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_GET_FMU_STATE);
    hsep_saved *old = NULL;
    hsep_saved *saved;
    unsigned char *block;
    hsep_header header;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL) {
        return hsep_refuse(instance, "fmi2GetFMUstate: FMUstate is NULL");
    }
    if (*FMUstate != NULL) {
        old = hsep_saved_of(instance, HSEP_CALL_GET_FMU_STATE, *FMUstate);
        if (old == NULL) {
            return fmi2Error;
        }
    }
    header = hsep_header_of(instance);
    saved = hsep_room(instance, old, (size_t)header.size);
    if (saved == NULL) {
        return hsep_refuse(instance, "fmi2GetFMUstate: no memory for %lu bytes", (unsigned long)header.size);
    }
    block = (unsigned char *)saved->block;
    memcpy(block, &header, sizeof header);
    memcpy(block + sizeof header, instance->values, HSEP_VALUES_SIZE);
    if (instance->state != NULL) {
        memcpy(block + HSEP_FIXED_SIZE, instance->state, instance->state_size);
    }
    if (old != NULL && old != saved) {
        hsep_free_saved(old);
    }
    *FMUstate = saved;
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_SET_FMU_STATE);
    const hsep_saved *saved;
    const unsigned char *block;
    hsep_header header;
    if (instance == NULL) {
        return fmi2Error;
    }
    saved = hsep_saved_of(instance, HSEP_CALL_SET_FMU_STATE, FMUstate);
    if (saved == NULL) {
        return fmi2Error;
    }
    block = (const unsigned char *)saved->block;
    memcpy(&header, block, sizeof header);
    if (strcmp(header.guid, HSEP_GUID) != 0) {
        return hsep_refuse(
            instance, "fmi2SetFMUstate: the state belongs to the FMU %s, not to %s", header.guid, HSEP_GUID);
    }
    if (header.state_size != instance->state_size) {
        void *state = NULL;
        if (header.state_size > 0) {
            state = hsep_new(instance, (size_t)header.state_size);
            if (state == NULL) {
                return hsep_refuse(
                    instance, "fmi2SetFMUstate: no memory for %lu bytes", (unsigned long)header.state_size);
            }
        }
        hsep_drop_state(instance);
        instance->state = state;
        instance->state_size = (size_t)header.state_size;
    }
    memcpy(instance->values, block + sizeof header, HSEP_VALUES_SIZE);
    if (instance->state != NULL) {
        memcpy(instance->state, block + HSEP_FIXED_SIZE, instance->state_size);
    }
    instance->phase = (hsep_phase)header.phase;
    instance->has_stop_time = (int)header.has_stop_time;
    instance->start_time = header.start_time;
    instance->stop_time = header.stop_time;
    instance->time = header.time;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_FREE_FMU_STATE);
    hsep_saved *saved;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL || *FMUstate == NULL) {
        return fmi2OK; /* the standard: freeing nothing is fine */
    }
    saved = hsep_saved_of(instance, HSEP_CALL_FREE_FMU_STATE, *FMUstate);
    if (saved == NULL) {
        return fmi2Error;
    }
    hsep_free_saved(saved);
    *FMUstate = NULL;
    return fmi2OK;
}

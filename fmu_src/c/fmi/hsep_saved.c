#include "hsep_saved.h"

#include "hsep_check.h"
#include "hsep_state.h"

#include <string.h>

HSEP_API int hsep_is_saved(const hsep_saved *saved)
{
    return memcmp(saved->magic, HSEP_SAVED_MAGIC, sizeof saved->magic) == 0;
}

HSEP_API void hsep_free_saved(hsep_saved *saved)
{
    memset(saved->magic, 0, sizeof saved->magic);
    saved->release(saved);
}

/* A new saved state with room for size bytes; NULL, with a message, if there is no memory. */
static hsep_saved *saved_new(const hsep_instance *instance, size_t size, char message[])
{
    hsep_saved *saved = hsep_new(instance, sizeof *saved + size);
    if (saved == NULL) {
        hsep_message_add(message, "no memory for %lu bytes", (unsigned long)size);
        return NULL;
    }
    memcpy(saved->magic, HSEP_SAVED_MAGIC, sizeof saved->magic);
    saved->capacity = size;
    saved->release = instance->release;
    return saved;
}

/* Put a new saved state where another one may be. */
static void saved_replace(hsep_saved **place, hsep_saved *saved)
{
    if (*place != NULL && *place != saved) {
        hsep_free_saved(*place);
    }
    *place = saved;
}

static size_t saved_values_size(const hsep_instance *instance)
{
    return hsep_instance_n_values(instance) * sizeof(double);
}

/* Bytes before the model's state. */
static size_t saved_fixed_size(const hsep_instance *instance)
{
    return sizeof(hsep_header) + saved_values_size(instance);
}

HSEP_API hsep_status hsep_save(const hsep_instance *instance, hsep_saved **place, char message[])
{
    hsep_header header = {
        .version = HSEP_SAVED_VERSION,
        .byte_order = HSEP_BYTE_ORDER,
        .size = saved_fixed_size(instance) + instance->state_size,
        .experiment = instance->experiment,
        .state_size = instance->state_size};
    memcpy(header.magic, HSEP_SAVED_MAGIC, sizeof header.magic);
    (void)strcpy(header.guid, instance->context.guid);
    const int fits = *place != NULL && (*place)->capacity >= header.size;
    hsep_saved *saved = fits ? *place : saved_new(instance, (size_t)header.size, message);
    if (saved == NULL) {
        return HSEP_REFUSED;
    }
    unsigned char *block = (unsigned char *)saved->block;
    memcpy(block, &header, sizeof header);
    memcpy(block + sizeof header, instance->values, saved_values_size(instance));
    if (instance->state != NULL) {
        memcpy(block + saved_fixed_size(instance), instance->state, instance->state_size);
    }
    saved_replace(place, saved);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_restore(hsep_instance *instance, const hsep_saved *saved, char message[])
{
    const unsigned char *block = (const unsigned char *)saved->block;
    hsep_header header;
    memcpy(&header, block, sizeof header);
    if (strcmp(header.guid, instance->context.guid) != 0) {
        return hsep_message_add(
            message, "the state belongs to the FMU %s, not to %s", header.guid, instance->context.guid);
    }
    if (header.size != saved_fixed_size(instance) + header.state_size) {
        return hsep_message_add(
            message, "the state has another number of variables than this instance: its Np is another one");
    }
    if (header.state_size != instance->state_size) {
        void *state = header.state_size > 0 ? hsep_new(instance, (size_t)header.state_size) : NULL;
        if (header.state_size > 0 && state == NULL) {
            return hsep_message_add(message, "no memory for %lu bytes", (unsigned long)header.state_size);
        }
        hsep_instance_drop_state(instance);
        instance->state = state;
        instance->state_size = (size_t)header.state_size;
    }
    memcpy(instance->values, block + sizeof header, saved_values_size(instance));
    if (instance->state != NULL) {
        memcpy(instance->state, block + saved_fixed_size(instance), instance->state_size);
    }
    instance->experiment = header.experiment;
    return HSEP_OK;
}

HSEP_API size_t hsep_saved_size(const hsep_saved *saved)
{
    hsep_header header;
    memcpy(&header, saved->block, sizeof header);
    return (size_t)header.size;
}

/* The checksum of a block whose header is this one. */
static uint64_t saved_checksum(hsep_header header, const unsigned char *block, size_t size)
{
    header.checksum = 0;
    return hsep_fnv(HSEP_FNV_BEGIN, &header, sizeof header) ^
           hsep_fnv(HSEP_FNV_BEGIN, block + sizeof header, size - sizeof header);
}

HSEP_API void hsep_serialise(const hsep_saved *saved, void *bytes)
{
    hsep_header header;
    memcpy(&header, saved->block, sizeof header);
    header.checksum = saved_checksum(header, (const unsigned char *)saved->block, (size_t)header.size);
    memcpy(bytes, saved->block, (size_t)header.size);
    memcpy(bytes, &header, sizeof header);
}

/* Say what is wrong with a serialised block that has at least a header's size; NULL if nothing is. */
static const char *saved_fault(const hsep_instance *instance, const hsep_saved *saved, size_t size, char message[])
{
    const unsigned char *block = (const unsigned char *)saved->block;
    const double *values = saved->block + sizeof(hsep_header) / sizeof(double);
    hsep_header header;
    memcpy(&header, block, sizeof header);
    if (memcmp(header.magic, HSEP_SAVED_MAGIC, sizeof header.magic) != 0 || header.byte_order != HSEP_BYTE_ORDER) {
        return "it is no state of this kind of FMU";
    }
    if (header.version != HSEP_SAVED_VERSION) {
        return "it is of another version";
    }
    if (strncmp(header.guid, instance->context.guid, sizeof header.guid) != 0) {
        return "it belongs to another FMU: the GUID differs";
    }
    if (header.size != size || header.state_size != size - saved_fixed_size(instance)) {
        return "it is truncated or too long, or its Np is another one";
    }
    if (header.checksum != saved_checksum(header, block, size)) {
        return "it is damaged: the checksum differs";
    }
    const uint32_t phase = header.experiment.phase;
    if (phase != HSEP_STEPPING && phase != HSEP_TERMINATED) {
        const int known = phase == HSEP_INSTANTIATED || phase == HSEP_INITIALIZATION;
        return known && header.state_size == 0 ? NULL
                                               : "it is inconsistent: its phase is unknown or has no model state";
    }
    const void *state = block + saved_fixed_size(instance);
    return hsep_model_check_state(&instance->context, state, (size_t)header.state_size, values, message) == HSEP_OK
               ? NULL
               : message;
}

HSEP_API hsep_status
hsep_deserialise(const hsep_instance *instance, const void *bytes, size_t size, hsep_saved **place, char message[])
{
    char detail[HSEP_MESSAGE_SIZE] = "";
    if (size < saved_fixed_size(instance)) {
        return hsep_message_add(
            message, "a state has at least %lu bytes, got %lu", (unsigned long)saved_fixed_size(instance),
            (unsigned long)size);
    }
    hsep_saved *saved = saved_new(instance, size, message);
    if (saved == NULL) {
        return HSEP_REFUSED;
    }
    memcpy(saved->block, bytes, size);
    const char *fault = saved_fault(instance, saved, size, detail);
    if (fault != NULL) {
        hsep_free_saved(saved);
        return hsep_message_add(message, "the state cannot be used: %s", fault);
    }
    saved_replace(place, saved);
    return HSEP_OK;
}

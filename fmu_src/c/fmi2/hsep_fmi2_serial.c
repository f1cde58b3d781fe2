/* A saved state as bytes that may leave the process, and back, with all doubts. */
#include "hsep_fmi2_saved.h"

#include <string.h>

/* FNV-1a, 64 bit. */
static uint64_t hsep_checksum(const unsigned char *bytes, size_t size)
{
    uint64_t sum = 14695981039346656037U;
    for (size_t i = 0; i < size; ++i) {
        sum = (sum ^ bytes[i]) * 1099511628211U;
    }
    return sum;
}

/* The checksum of a block whose header is this one. */
static uint64_t hsep_block_checksum(hsep_header header, const unsigned char *block, size_t size)
{
    header.checksum = 0;
    return hsep_checksum((const unsigned char *)&header, sizeof header) ^
           hsep_checksum(block + sizeof header, size - sizeof header);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_SERIALIZED_FMU_STATE_SIZE);
    const hsep_saved *saved;
    hsep_header header;
    if (instance == NULL) {
        return fmi2Error;
    }
    saved = hsep_saved_of(instance, HSEP_CALL_SERIALIZED_FMU_STATE_SIZE, FMUstate);
    if (saved == NULL) {
        return fmi2Error;
    }
    if (size == NULL) {
        return hsep_refuse(instance, "fmi2SerializedFMUstateSize: size is NULL");
    }
    memcpy(&header, saved->block, sizeof header);
    *size = (size_t)header.size;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_SERIALIZE_FMU_STATE);
    const hsep_saved *saved;
    hsep_header header;
    if (instance == NULL) {
        return fmi2Error;
    }
    saved = hsep_saved_of(instance, HSEP_CALL_SERIALIZE_FMU_STATE, FMUstate);
    if (saved == NULL) {
        return fmi2Error;
    }
    memcpy(&header, saved->block, sizeof header);
    if (serializedState == NULL || size < header.size) {
        return hsep_refuse(
            instance, "fmi2SerializeFMUstate: serializedState must have room for %lu bytes, got %lu%s",
            (unsigned long)header.size, (unsigned long)size, (serializedState == NULL) ? " and NULL" : "");
    }
    header.checksum = hsep_block_checksum(header, (const unsigned char *)saved->block, (size_t)header.size);
    memcpy(serializedState, saved->block, (size_t)header.size);
    memcpy(serializedState, &header, sizeof header);
    return fmi2OK;
}

/* Say what is wrong with a serialised block that has at least a header's size; NULL if nothing is. */
static const char *hsep_block_fault(hsep_instance *instance, const hsep_saved *saved, size_t size, char message[])
{
    const unsigned char *block = (const unsigned char *)saved->block;
    const double *values = saved->block + sizeof(hsep_header) / sizeof(double);
    hsep_header header;
    size_t state_size = 0;
    int running;
    memcpy(&header, block, sizeof header);
    if (memcmp(header.magic, HSEP_SAVED_MAGIC, sizeof header.magic) != 0 || header.byte_order != HSEP_BYTE_ORDER) {
        return "it is no state of this kind of FMU";
    }
    if (header.version != HSEP_SAVED_VERSION) {
        return "it is of another version";
    }
    if (memcmp(header.guid, HSEP_GUID, sizeof HSEP_GUID) != 0) {
        return "it belongs to another FMU: the GUID differs";
    }
    if (header.size != size || header.state_size != size - HSEP_FIXED_SIZE) {
        return "it is truncated or too long";
    }
    if (header.checksum != hsep_block_checksum(header, block, size)) {
        return "it is damaged: the checksum differs";
    }
    running = header.phase == HSEP_STEPPING || header.phase == HSEP_TERMINATED;
    if (!running) {
        const int known = header.phase == HSEP_INSTANTIATED || header.phase == HSEP_INITIALIZATION;
        return (known && header.state_size == 0) ? NULL : "it does not hold together";
    }
    if (hsep_model_size(&instance->context, values, &state_size, message) != HSEP_OK) {
        return message;
    }
    if (state_size != header.state_size) {
        return "its size does not fit its parameters";
    }
    if (hsep_model_check_state(&instance->context, block + HSEP_FIXED_SIZE, state_size, values, message) != HSEP_OK) {
        return message;
    }
    return NULL;
}

fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    hsep_instance *instance = hsep_begin(c, HSEP_CALL_DESERIALIZE_FMU_STATE);
    char message[HSEP_MESSAGE_SIZE] = "";
    hsep_saved *old = NULL;
    hsep_saved *saved;
    const char *fault;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (serializedState == NULL || FMUstate == NULL) {
        return hsep_refuse(
            instance, "fmi2DeSerializeFMUstate: %s is NULL",
            (serializedState == NULL) ? "serializedState" : "FMUstate");
    }
    if (size < HSEP_FIXED_SIZE) {
        return hsep_refuse(
            instance, "fmi2DeSerializeFMUstate: a state has at least %lu bytes, got %lu",
            (unsigned long)HSEP_FIXED_SIZE, (unsigned long)size);
    }
    if (*FMUstate != NULL) {
        old = hsep_saved_of(instance, HSEP_CALL_DESERIALIZE_FMU_STATE, *FMUstate);
        if (old == NULL) {
            return fmi2Error;
        }
    }
    saved = hsep_room(instance, NULL, size);
    if (saved == NULL) {
        return hsep_refuse(instance, "fmi2DeSerializeFMUstate: no memory for %lu bytes", (unsigned long)size);
    }
    memcpy(saved->block, serializedState, size);
    fault = hsep_block_fault(instance, saved, size, message);
    if (fault != NULL) {
        hsep_free_saved(saved);
        return hsep_refuse(instance, "fmi2DeSerializeFMUstate: the state cannot be used: %s", fault);
    }
    if (old != NULL) {
        hsep_free_saved(old);
    }
    *FMUstate = saved;
    return fmi2OK;
}

/* Complete state of an instance as one block of bytes, saved, restored and serialised by copying.
 *
 * header | values, hsep_instance_n_values doubles | the model's state, of hsep_model_size
 *
 * Numbers are in the machine's own representation; a serialised block of another byte order is refused, as is one of
 * another FMU (GUID), another version, another length or with a single bit changed (CRC-32), and one of FMI 3.0 whose
 * windows have another Np.
 */
#include "hsep_calls.h"

#include "hsep_crc.h"

#define SAVED_VERSION 47U /* changes whenever the layout of any state does */
#define SAVED_BYTE_ORDER 0x01020304U
#define SAVED_MAGIC "HSEPFMI2"

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order;
    char guid[HSEP_GUID_SIZE];
    uint64_t size;     /* bytes of the whole block */
    uint64_t checksum; /* of the whole block, with 0 here */
    hsep_experiment experiment;
    uint64_t state_size; /* bytes of the model's state */
} saved_header;
HSEP_ASSERT_WORDS(saved_header, 15);

/* What an importer's handle points to. */
typedef struct {
    char magic[8];
    size_t capacity; /* bytes that the block has room for */
    hsep_release release;
    saved_header header;
    double values[]; /* then the model's state, aligned for double */
} hsep_saved;

/* Check that a handle is a saved state. */
static hsep_status saved_check(const hsep_instance *instance, const hsep_call *call, const hsep_saved *saved)
{
    if (saved == NULL) {
        return hsep_refuse(instance, "%s: the state is NULL", call->name);
    }
    const int is_ours = memcmp(saved->magic, SAVED_MAGIC, sizeof saved->magic) == 0;
    return is_ours ? HSEP_OK : hsep_refuse(instance, "%s: the state is none of this FMU", call->name);
}

/* The same where a place for a handle is given, which may hold none. */
static hsep_status saved_check_place(const hsep_instance *instance, const hsep_call *call, void **place)
{
    return place == NULL || *place == NULL ? HSEP_OK : saved_check(instance, call, *place);
}

static void saved_free(hsep_saved *saved)
{
    memset(saved->magic, 0, sizeof saved->magic);
    saved->release(saved);
}

/* A new saved state with room for a block of this size, bytes; NULL, with a message, if there is no memory. */
static hsep_saved *saved_new(hsep_instance *instance, const hsep_call *call, size_t size)
{
    hsep_saved *saved = hsep_new(instance, sizeof *saved - sizeof saved->header + size);
    if (saved == NULL) {
        (void)hsep_refuse(instance, "%s: no memory for %lu bytes", call->name, (unsigned long)size);
        return NULL;
    }
    memcpy(saved->magic, SAVED_MAGIC, sizeof saved->magic);
    saved->capacity = size;
    saved->release = instance->release;
    return saved;
}

/* Put a new saved state where another one may be. */
static void saved_replace(void **place, hsep_saved *saved)
{
    if (*place != NULL) {
        saved_free(*place);
    }
    *place = saved;
}

/* Bytes before the model's state. */
static size_t saved_fixed_size(const hsep_instance *instance)
{
    return sizeof(saved_header) + hsep_instance_n_values(instance) * sizeof(double);
}

HSEP_API hsep_status hsep_call_save(hsep_instance *instance, const hsep_call *call, void **state)
{
    if (saved_check_place(instance, call, state) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (state == NULL) {
        return hsep_refuse(instance, "%s: the place of the state is NULL", call->name);
    }
    const size_t n = hsep_instance_n_values(instance), size = saved_fixed_size(instance) + instance->state_size;
    hsep_saved *saved = *state;
    if (saved == NULL || saved->capacity < size) {
        saved = saved_new(instance, call, size);
        if (saved == NULL) {
            return HSEP_REFUSED;
        }
        saved_replace(state, saved);
    }
    saved->header = (saved_header){
        .version = SAVED_VERSION,
        .byte_order = SAVED_BYTE_ORDER,
        .size = size,
        .experiment = instance->experiment,
        .state_size = instance->state_size};
    memcpy(saved->header.magic, SAVED_MAGIC, sizeof saved->header.magic);
    (void)strcpy(saved->header.guid, instance->context.guid);
    memcpy(saved->values, instance->values, n * sizeof(double));
    if (instance->state != NULL) {
        memcpy(saved->values + n, instance->state, instance->state_size);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_restore(hsep_instance *instance, const hsep_call *call, void *state)
{
    const hsep_saved *saved = state;
    if (saved_check(instance, call, saved) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    const size_t n = hsep_instance_n_values(instance), size = (size_t)saved->header.state_size;
    if (strcmp(saved->header.guid, instance->context.guid) != 0) {
        return hsep_refuse(
            instance, "%s: the state belongs to the FMU %s, not to %s", call->name, saved->header.guid,
            instance->context.guid);
    }
    if (saved->header.size != saved_fixed_size(instance) + size) {
        return hsep_refuse(
            instance, "%s: the state has another number of variables than this instance: its Np is another one",
            call->name);
    }
    if (size != instance->state_size) {
        void *block = size > 0 ? hsep_new(instance, size) : NULL;
        if (size > 0 && block == NULL) {
            return hsep_refuse(instance, "%s: no memory for %lu bytes", call->name, (unsigned long)size);
        }
        hsep_instance_drop_state(instance);
        instance->state = block;
        instance->state_size = size;
    }
    memcpy(instance->values, saved->values, n * sizeof(double));
    if (size > 0) {
        memcpy(instance->state, saved->values + n, size);
    }
    instance->experiment = saved->header.experiment;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_free_state(hsep_instance *instance, const hsep_call *call, void **state)
{
    if (saved_check_place(instance, call, state) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (state != NULL) { /* the standard: freeing nothing is fine */
        saved_replace(state, NULL);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_call_state_size(hsep_instance *instance, const hsep_call *call, void *state, size_t *size)
{
    const hsep_saved *saved = state;
    if (saved_check(instance, call, saved) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (size == NULL) {
        return hsep_refuse(instance, "%s: size is NULL", call->name);
    }
    *size = (size_t)saved->header.size;
    return HSEP_OK;
}

/* The checksum of a block. */
static uint64_t saved_checksum(const hsep_saved *saved)
{
    saved_header header = saved->header;
    header.checksum = 0;
    return ((uint64_t)hsep_crc(&header, sizeof header) << 32) +
           hsep_crc(saved->values, (size_t)header.size - sizeof header);
}

HSEP_API hsep_status
hsep_call_serialise(hsep_instance *instance, const hsep_call *call, void *state, void *bytes, size_t size)
{
    const hsep_saved *saved = state;
    if (saved_check(instance, call, saved) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    const size_t needed = (size_t)saved->header.size;
    if (bytes == NULL || size < needed) {
        return hsep_refuse(
            instance, "%s: serializedState must have room for %lu bytes, got %lu%s", call->name, (unsigned long)needed,
            (unsigned long)size, bytes == NULL ? " and NULL" : "");
    }
    saved_header header = saved->header;
    header.checksum = saved_checksum(saved);
    memcpy(bytes, &header, sizeof header);
    memcpy((char *)bytes + sizeof header, saved->values, needed - sizeof header);
    return HSEP_OK;
}

/* Say what is wrong with a serialised block, of at least a header and values; NULL if nothing is. */
static const char *saved_fault(const hsep_instance *instance, const hsep_saved *saved, char message[])
{
    const saved_header *header = &saved->header;
    const size_t size = saved->capacity, state_size = (size_t)header->state_size;
    if (memcmp(header->magic, SAVED_MAGIC, sizeof header->magic) != 0 || header->byte_order != SAVED_BYTE_ORDER) {
        return "it is no state of this kind of FMU";
    }
    if (header->version != SAVED_VERSION) {
        return "it is of another version";
    }
    if (strncmp(header->guid, instance->context.guid, sizeof header->guid) != 0) {
        return "it belongs to another FMU: the GUID differs";
    }
    if (header->size != size || header->state_size != size - saved_fixed_size(instance)) {
        return "it is truncated or too long, or its Np is another one";
    }
    if (header->checksum != saved_checksum(saved)) {
        return "it is damaged: the checksum differs";
    }
    const uint32_t phase = header->experiment.phase;
    if (phase != HSEP_STEPPING && phase != HSEP_TERMINATED) {
        const int known = phase == HSEP_INSTANTIATED || phase == HSEP_INITIALIZATION;
        return known && state_size == 0 ? NULL : "it is inconsistent: its phase is unknown or has no model state";
    }
    size_t expected = 0;
    if (hsep_model_size(&instance->context, saved->values, &expected, message) != HSEP_OK) {
        return message;
    }
    return state_size == expected ? NULL : "it is inconsistent: its size is not that of its parameters";
}

HSEP_API hsep_status
hsep_call_deserialise(hsep_instance *instance, const hsep_call *call, const void *bytes, size_t size, void **state)
{
    char message[HSEP_MESSAGE_SIZE] = "";
    if (saved_check_place(instance, call, state) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (bytes == NULL || state == NULL) {
        return hsep_refuse(
            instance, "%s: %s is NULL", call->name, bytes == NULL ? "serializedState" : "the place of the state");
    }
    if (size < saved_fixed_size(instance)) {
        return hsep_refuse(
            instance, "%s: a state has at least %lu bytes, got %lu", call->name,
            (unsigned long)saved_fixed_size(instance), (unsigned long)size);
    }
    hsep_saved *saved = saved_new(instance, call, size);
    if (saved == NULL) {
        return HSEP_REFUSED;
    }
    memcpy(&saved->header, bytes, sizeof saved->header);
    memcpy(saved->values, (const char *)bytes + sizeof saved->header, size - sizeof saved->header);
    const char *fault = saved_fault(instance, saved, message);
    if (fault != NULL) {
        saved_free(saved);
        return hsep_refuse(instance, "%s: the state cannot be used: %s", call->name, fault);
    }
    saved_replace(state, saved);
    return HSEP_OK;
}

#include "hsep_state.h"

#include "hsep_check.h"
#include "hsep_table.h"

#include <stdint.h>
#include <string.h>

HSEP_API hsep_status hsep_state_size(double bytes, size_t *size, char message[])
{
    if (!(bytes < 0.5 * (double)SIZE_MAX)) {
        return hsep_message_add(
            message, "the state must fit into memory, got %.4g bytes for these parameters; lower Np, p or q", bytes);
    }
    *size = (size_t)bytes;
    return HSEP_OK;
}

HSEP_API uint64_t hsep_fnv(uint64_t hash, const void *bytes, size_t size)
{
    const unsigned char *byte = bytes;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ byte[i]) * UINT64_C(0x100000001B3);
    }
    return hash;
}

/* A hash of the values of all parameters that are not tunable. */
static uint64_t state_hash(const hsep_context *context, const double values[])
{
    uint64_t hash = HSEP_FNV_BEGIN;
    for (size_t i = 0; i < context->n_variables; i++) {
        const hsep_variable *row = hsep_table_row(context, i);
        if (row->causality == HSEP_PARAMETER && !row->tunable) {
            hash = hsep_fnv(hash, &values[i], sizeof values[i]);
        }
    }
    return hash;
}

HSEP_API hsep_status hsep_state_begin(
    hsep_state_header *header, const hsep_context *context, const double values[], size_t needed, size_t size,
    char message[])
{
    if (needed != size) {
        return hsep_message_add(
            message,
            "the state must have %.0f bytes, got memory for %.0f; its file in the resources has changed meanwhile: "
            "initialise again",
            (double)needed, (double)size);
    }
    *header = (hsep_state_header){HSEP_STATE_VERSION, context->n_variables, size, state_hash(context, values)};
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_check_state(
    const hsep_context *context, const void *state, size_t size, const double values[], char message[])
{
    hsep_state_header header;
    size_t expected = 0;
    if (hsep_model_size(context, values, &expected, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (size < sizeof header || size != expected) {
        return hsep_message_add(
            message, "the state must have %.0f bytes, got %.0f; it is truncated or of another FMU", (double)expected,
            (double)size);
    }
    memcpy(&header, state, sizeof header);
    if (header.version != HSEP_STATE_VERSION) {
        return hsep_message_add(
            message, "the state must be of version %d, got %.0f", HSEP_STATE_VERSION, (double)header.version);
    }
    if (header.variables != context->n_variables || header.size != size ||
        header.parameters != state_hash(context, values)) {
        return hsep_message_add(message, "the state was saved with other parameters than this instance has");
    }
    return HSEP_OK;
}

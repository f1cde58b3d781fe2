/* The complete state of an instance as one block of bytes: saved, restored, serialised by copying it.
 *
 * header | values, HSEP_N_VALUES doubles | the model's state, as hsep_model_size tells
 *
 * Numbers are in the machine's own representation; a serialised block of another byte order is refused, as is one of
 * another FMU (GUID), another version, another length or with a single bit changed (FNV-1a).
 */
#ifndef HSEP_FMI2_SAVED_H
#define HSEP_FMI2_SAVED_H

#include "hsep_api.h"
#include "hsep_fmi2_instance.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_SAVED_VERSION 2U
#define HSEP_BYTE_ORDER 0x01020304U
#define HSEP_SAVED_MAGIC "HSEPFMI2"
#define HSEP_GUID_SIZE 48 /* a GUID in braces, padded with zeros */

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order;
    char guid[HSEP_GUID_SIZE];
    uint64_t size;     /* bytes of the whole block */
    uint64_t checksum; /* of the whole block, with 0 here */
    uint32_t phase;
    uint32_t has_stop_time;
    double start_time;
    double stop_time;
    double time;
    uint64_t state_size; /* bytes of the model's state */
} hsep_header;

HSEP_ASSERT_WORDS(hsep_header, 15);

/* What an fmi2FMUstate points to. */
typedef struct {
    char magic[8];
    size_t capacity; /* bytes that block has room for */
    hsep_release release;
    double block[]; /* header, values, state; aligned for double */
} hsep_saved;

enum { HSEP_VALUES_SIZE = HSEP_N_VALUES * sizeof(double), HSEP_FIXED_SIZE = sizeof(hsep_header) + HSEP_VALUES_SIZE };

/* The saved state behind a handle; NULL, with a message, if there is none. */
HSEP_API hsep_saved *hsep_saved_of(hsep_instance *instance, hsep_call call, fmi2FMUstate state);

/* saved if it has room for size bytes, otherwise a new one to take its place; NULL if there is no memory. */
HSEP_API hsep_saved *hsep_room(hsep_instance *instance, hsep_saved *saved, size_t size);

/* Give a saved state back. */
HSEP_API void hsep_free_saved(hsep_saved *saved);

#endif

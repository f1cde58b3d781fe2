/* Complete state of an instance as one block of bytes, saved, restored and serialised by copying.
 *
 * header | values, hsep_instance_n_values doubles | the model's state, of hsep_model_size
 *
 * Numbers are in the machine's own representation; a serialised block of another byte order is refused, as is one of
 * another FMU (GUID), another version, another length or with a single bit changed (FNV-1a), and one of FMI 3.0 whose
 * windows have another Np. What fails returns
 * HSEP_REFUSED, changes nothing and says why.
 */
#ifndef HSEP_SAVED_H
#define HSEP_SAVED_H

#include "hsep_api.h"
#include "hsep_instance.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_SAVED_VERSION 3U
#define HSEP_BYTE_ORDER 0x01020304U
#define HSEP_SAVED_MAGIC "HSEPFMI2"

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order;
    char guid[HSEP_GUID_SIZE];
    uint64_t size;     /* bytes of the whole block */
    uint64_t checksum; /* of the whole block, with 0 here */
    hsep_experiment experiment;
    uint64_t state_size; /* bytes of the model's state */
} hsep_header;

HSEP_ASSERT_WORDS(hsep_header, 15);

/* What an importer's handle points to. */
typedef struct {
    char magic[8];
    size_t capacity; /* bytes that block has room for */
    hsep_release release;
    double block[]; /* header, values, state; aligned for double */
} hsep_saved;

/* Whether a handle points to a saved state. */
HSEP_API int hsep_is_saved(const hsep_saved *saved);

/* Save an instance in *saved if it has room, otherwise in a new block in its place; it may be NULL. */
HSEP_API hsep_status hsep_save(const hsep_instance *instance, hsep_saved **saved, char message[]);

HSEP_API hsep_status hsep_restore(hsep_instance *instance, const hsep_saved *saved, char message[]);

/* Bytes of a saved state. */
HSEP_API size_t hsep_saved_size(const hsep_saved *saved);

/* Write a saved state, with its checksum, to hsep_saved_size bytes. */
HSEP_API void hsep_serialise(const hsep_saved *saved, void *bytes);

/* Read a saved state from bytes that may come from anywhere; it takes the place of *saved, which may be NULL. */
HSEP_API hsep_status
hsep_deserialise(const hsep_instance *instance, const void *bytes, size_t size, hsep_saved **saved, char message[]);

/* Give a saved state back. */
HSEP_API void hsep_free_saved(hsep_saved *saved);

#endif

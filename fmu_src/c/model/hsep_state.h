/* Header of every model's state: version, size, number of variables and hash of the parameters. */
#ifndef HSEP_STATE_H
#define HSEP_STATE_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_model.h"

#include <stdint.h>

#define HSEP_STATE_VERSION 30 /* changes whenever the layout of any state does */

typedef struct {
    uint64_t version;    /* HSEP_STATE_VERSION */
    uint64_t variables;  /* their number */
    uint64_t size;       /* of the whole state, bytes */
    uint64_t parameters; /* a hash of the values of all parameters that are not tunable */
} hsep_state_header;

HSEP_ASSERT_WORDS(hsep_state_header, 4);

#define HSEP_FNV_BEGIN UINT64_C(0xCBF29CE484222325)

/* FNV-1a, 64 bit (Fowler, Noll and Vo 1991), of further bytes, hash being the hash of the bytes before; HSEP_FNV_BEGIN
 * at first. */
HSEP_API uint64_t hsep_fnv(uint64_t hash, const void *bytes, size_t size);

/* Turn a size that was counted in double into bytes. Fails if it is more than memory can be asked for. */
HSEP_API hsep_status hsep_state_size(double bytes, size_t *size, char message[]);

/* Fill the header of a state in memory of size bytes. Fails if it needs another size: a resource may have changed since
 * the size was told. */
HSEP_API hsep_status hsep_state_begin(
    hsep_state_header *header, const hsep_context *context, const double values[], size_t needed, size_t size,
    char message[]);

#endif

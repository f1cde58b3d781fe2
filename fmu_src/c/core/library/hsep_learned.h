/* What was learned, as the file weights.bin has it; hybridsep/fmi/weights.py writes it.
 *
 * Little-endian: the head; the settings that shape features and factors; as doubles the numbers of
 * hsep_learned, and of hsep_uncertainty from theta on; for each factor [R z; 0 rho] of what is learned its
 * weighted number of rows and its upper triangle by rows, (n + 1)(n + 2)/2 doubles for n features; the CRC-32 of all
 * before as uint64. Reentrant; allocates nothing. */
#ifndef HSEP_LEARNED_H
#define HSEP_LEARNED_H

#include "hsep_predictor.h"

#define HSEP_LEARNED_MAGIC "HSEPWG16"

typedef struct {
    char magic[8];
    uint64_t n_settings, n_modes, n_learned; /* learned: numbers besides the factors */
} hsep_learned_head;

HSEP_ASSERT(learned_head, sizeof(hsep_learned_head) == 32);

typedef struct {
    char name[24]; /* filled with 0 */
    double value;
} hsep_learned_setting;

HSEP_ASSERT(learned_setting, sizeof(hsep_learned_setting) == 32);

/* Bytes of a file that are still to be read, in any alignment. */
typedef struct {
    const unsigned char *bytes;
    size_t left;
} hsep_learned_bytes;

/* Read exactly size bytes; 0 if there are less. */
HSEP_API int hsep_learned_read(hsep_learned_bytes *from, void *to, size_t size);

/* Read the next setting; 0 if there is none, or its name does not end. */
HSEP_API int hsep_learned_next(hsep_learned_bytes *from, hsep_learned_setting *setting);

/* Take all of the bytes of a file, or NULL. HSEP_BEGAN: taken; otherwise the predictor may have changed. */
HSEP_API hsep_began
hsep_learned_load(hsep_predictor *predictor, const hsep_parameters *parameters, const void *bytes, size_t size);

#endif

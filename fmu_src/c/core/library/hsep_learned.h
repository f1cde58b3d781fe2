/* What was learned, as the file weights.bin has it: a head, the settings that it was learned with, numbers, factors and
 * the CRC-32 of all before; hybridsep/fmi/weights.py writes it. Reentrant; allocates nothing. */
#ifndef HSEP_LEARNED_H
#define HSEP_LEARNED_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_parameters.h"
#include "hsep_predictor.h"

#include <stddef.h>
#include <stdint.h>

#define HSEP_LEARNED_MAGIC "HSEPWG14"

typedef struct {
    char magic[8];
    uint64_t n_settings, n_modes, n_learned;
} hsep_learned_head;

HSEP_ASSERT(learned_head, sizeof(hsep_learned_head) == 32);

typedef struct {
    char name[24]; /* filled with 0 */
    double value;
} hsep_learned_setting;

HSEP_ASSERT(learned_setting, sizeof(hsep_learned_setting) == 32);

/* Where the bytes come from: read up to so many of them and return how many there were. */
typedef struct hsep_learned_source hsep_learned_source;
struct hsep_learned_source {
    size_t (*read)(hsep_learned_source *self, void *to, size_t size);
    const unsigned char *bytes; /* bytes in memory, */
    size_t left;                /* their number */
    void *file;                 /* or what another source reads from */
};

/* Bytes in memory, in any alignment. */
HSEP_API hsep_learned_source hsep_learned_in_memory(const void *bytes, size_t size);

/* Read exactly so many bytes; 0 if there are less. */
HSEP_API int hsep_learned_read(hsep_learned_source *source, void *to, size_t size);

/* Read n numbers, which a file has in 8 bytes each; 0 if there are less. */
HSEP_API int hsep_learned_numbers(hsep_learned_source *source, hsep_real to[], uint64_t n);

/* Sum up a source to its end; whether its last 8 bytes are the checksum of the others. size: of all of it, bytes. */
HSEP_API int hsep_learned_whole(hsep_learned_source *source, double *size);

/* Take what follows the settings, of a source of so many bytes that is whole: 0 if it is not what these settings learn.
 * Until it has returned 1 the predictor may have changed. */
HSEP_API int hsep_learned_take(
    hsep_learned_source *source, const hsep_learned_head *head, double size, hsep_predictor *predictor);

/* Take all of the bytes of a file. HSEP_BEGAN: taken; otherwise the predictor may have changed. */
HSEP_API hsep_began
hsep_learned_load(hsep_predictor *predictor, const hsep_parameters *parameters, const void *bytes, size_t size);

#endif

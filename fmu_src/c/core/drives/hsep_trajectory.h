/* Sampled reference trajectory, held at its last sample. The samples follow the struct
 * in one block, without pointers. Reentrant; constant cost; allocates nothing. */
#ifndef HSEP_TRAJECTORY_H
#define HSEP_TRAJECTORY_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

typedef struct {
    uint64_t count; /* samples, >= 1 */
    /* followed by double[count], m */
} hsep_trajectory;

HSEP_ASSERT_WORDS(hsep_trajectory, 1);

HSEP_API double hsep_trajectory_size(uint64_t count); /* bytes of the block, counted in double */

HSEP_API double *hsep_trajectory_samples(hsep_trajectory *self); /* (count,), m, to be filled by the caller */

/* Return the commanded position at sample k >= 0, m. */
HSEP_API double hsep_trajectory_position(const hsep_trajectory *self, int64_t k);

#endif

/* Position sensor with Gaussian noise from a portable generator: SplitMix64 (Steele, Lea and Flood
 * 2014) gives two uniform numbers per sample, the Box-Muller transform (1958) one normal number. Plain data;
 * reentrant. */
#ifndef HSEP_ENCODER_H
#define HSEP_ENCODER_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

typedef struct {
    double noise_std; /* m, >= 0 */
    uint64_t seed;
    uint64_t n_draws; /* so far */
} hsep_encoder;

HSEP_ASSERT_WORDS(hsep_encoder, 3);

HSEP_API void hsep_encoder_init(hsep_encoder *self, double noise_std, uint64_t seed);

/* Return one measurement of the position x, m. Constant cost; allocates nothing; cannot fail. */
HSEP_API double hsep_encoder_measure(hsep_encoder *self, double x);

#endif

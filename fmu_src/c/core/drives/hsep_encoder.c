#include "hsep_encoder.h"

#include "hsep_math.h"

/* The index-th number of the SplitMix64 sequence of a seed. */
static uint64_t encoder_split_mix_64(uint64_t seed, uint64_t index)
{
    uint64_t z = seed + (index + 1) * UINT64_C(0x9E3779B97F4A7C15);
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

HSEP_API void hsep_encoder_init(hsep_encoder *self, double noise_std, uint64_t seed)
{
    self->noise_std = noise_std;
    self->seed = seed;
    self->n_draws = 0;
}

HSEP_API double hsep_encoder_measure(hsep_encoder *self, double x)
{
    const uint64_t first = 2 * self->n_draws;
    self->n_draws++;
    /* Uniform in (0, 1] and [0, 1), 53 bits each */
    const double u1 = ldexp((double)((encoder_split_mix_64(self->seed, first) >> 11) + 1), -53);
    const double u2 = ldexp((double)(encoder_split_mix_64(self->seed, first + 1) >> 11), -53);
    return x + self->noise_std * sqrt(-2.0 * log(u1)) * cos(HSEP_TWO_PI * u2);
}

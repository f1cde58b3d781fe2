#include "hsep_trajectory.h"

HSEP_API double hsep_trajectory_size(uint64_t count)
{
    return (double)sizeof(hsep_trajectory) + (double)count * (double)sizeof(double);
}

HSEP_API double *hsep_trajectory_samples(hsep_trajectory *self) { return (double *)(self + 1); }

HSEP_API double hsep_trajectory_position(const hsep_trajectory *self, int64_t k)
{
    const double *samples = (const double *)(self + 1);
    return samples[(uint64_t)k < self->count ? (uint64_t)k : self->count - 1];
}

#include "hsep_clock.h"

#include <math.h>

static const double clock_parts_max = 1e9;     /* steps shorter than T_s / 1e9 are refused */
static const double clock_tolerance = 1e-6;    /* of T_s */

HSEP_API void hsep_clock_init(hsep_clock *self, double start, double T_s)
{
    self->start = start;
    self->T_s = T_s;
    self->k = 0;
    self->done = 0;
    self->parts = 1;
}

HSEP_API hsep_clock_fit hsep_clock_check(const hsep_clock *self, double t, double h, int64_t *parts)
{
    const double count = h > 0.0 ? floor(self->T_s / h + 0.5) : 0.0;
    if (!(count >= 1.0 && count <= clock_parts_max && fabs(count * h - self->T_s) <= clock_tolerance * self->T_s)) {
        return HSEP_CLOCK_STEP_SIZE;
    }
    *parts = (int64_t)count;
    if (self->done > 0 && *parts != self->parts) {
        return HSEP_CLOCK_MIXED_SIZE;
    }
    if (!(fabs(t - hsep_clock_expected(self, *parts)) <= 0.5 * h)) {
        return HSEP_CLOCK_POINT;
    }
    return HSEP_CLOCK_FITS;
}

HSEP_API double hsep_clock_expected(const hsep_clock *self, int64_t parts)
{
    return self->start + ((double)self->k + (double)self->done / (double)parts) * self->T_s;
}

HSEP_API int hsep_clock_advance(hsep_clock *self, int64_t parts)
{
    self->parts = parts;
    self->done++;
    if (self->done < parts) {
        return 0;
    }
    self->k++;
    self->done = 0;
    return 1;
}

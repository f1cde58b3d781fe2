#include "hsep_held.h"

#include <math.h>

static const double held_repeats = 3.0; /* equal consecutive values from which one may be held */
static const double held_steps = 5.0;   /* predicted motion, in resolution steps, within which they are plausible */

HSEP_API void hsep_held_init(hsep_held *self)
{
    self->value = NAN;
    self->repeats = self->low = self->high = 0.0;
    self->step = HUGE_VAL;
}

HSEP_API int hsep_held_holds(hsep_held *self, double x_meas, double x_pb, double still)
{
    if (!(x_meas == self->value)) {
        if (!isnan(self->value)) {
            self->step = fmin(self->step, fabs(x_meas - self->value));
        }
        self->value = x_meas;
        self->repeats = 0.0;
        self->low = self->high = x_pb;
    }
    self->repeats += 1.0;
    self->low = fmin(self->low, x_pb);
    self->high = fmax(self->high, x_pb);
    return hsep_held_stays(self, self->high - self->low, still, HUGE_VAL);
}

HSEP_API int hsep_held_stays(const hsep_held *self, double motion, double still, double first_step)
{
    const double step = self->step < HUGE_VAL ? self->step : first_step;
    return self->repeats >= held_repeats && motion > fmax(held_steps * step, still);
}

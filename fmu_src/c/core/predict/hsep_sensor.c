#include "hsep_sensor.h"

#include <math.h>

static const double sensor_repeats = 3.0; /* equal consecutive values from which one may be held */
static const double sensor_steps = 5.0;   /* predicted motion, in resolution steps, within which they are plausible */

HSEP_API void hsep_sensor_init(hsep_sensor *self)
{
    self->value = NAN;
    self->repeats = self->low = self->high = 0.0;
    self->step = HUGE_VAL;
}

HSEP_API int hsep_sensor_misses(hsep_sensor *self, double x_meas, double x_pb, double still)
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
    return hsep_sensor_stays(self, self->high - self->low, still, HUGE_VAL);
}

HSEP_API int hsep_sensor_stays(const hsep_sensor *self, double motion, double still, double first_step)
{
    const double step = self->step < HUGE_VAL ? self->step : first_step;
    return self->repeats >= sensor_repeats && motion > fmax(sensor_steps * step, still);
}

/* Velocity of a drive whose friction acts on that velocity without delay. Plain data; reentrant; allocates nothing. */
#ifndef HSEP_FRICTION_H
#define HSEP_FRICTION_H

#include "hsep_api.h"

/* The solution of v = w - gain tanh(v / scale), m/s: w is the velocity without friction, gain the velocity that the
 * whole friction takes away at once. For gain < -scale there are two stable solutions: the one in the direction of
 * last, the velocity before, holds until it ends (hysteresis). Cost: at most 60 Newton steps, usually 4 to 8. */
HSEP_API double hsep_friction_velocity(double w, double gain, double scale, double last);

#endif

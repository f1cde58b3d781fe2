#include "hsep_friction.h"

#include <math.h>

enum { FRICTION_STEPS_MAX = 60 };

static const double friction_tolerance = 1e-15; /* of a Newton step, relative */

HSEP_API double hsep_friction_velocity(double w, double gain, double scale, double last)
{
    if (w == 0.0 && last == 0.0) {
        return 0.0;
    }
    double sign = copysign(1.0, w);
    if (gain < -scale) {
        /* v + gain tanh(v / scale) falls between +-turn: a solution of the other sign than w may be there */
        const double ratio = -gain / scale, turn = scale * log(sqrt(ratio) + sqrt(ratio - 1.0));
        if (last * w < 0.0 && fabs(w) <= -turn - gain * tanh(turn / scale)) {
            sign = -sign;
        }
    }
    w *= sign;
    /* Newton from the side where its steps are monotone: v + gain tanh(v / scale) is concave or convex for v > 0. */
    double v = gain > 0.0 ? fmax(w - gain, w / (1.0 + gain / scale)) : w - gain;
    for (int i = 0; i < FRICTION_STEPS_MAX; i++) {
        const double t = tanh(v / scale), slope = 1.0 + gain / scale * (1.0 - t * t);
        if (!(slope > 0.0)) {
            break;
        }
        const double step = (v + gain * t - w) / slope;
        v -= step;
        if (fabs(step) <= friction_tolerance * fabs(v)) {
            break;
        }
    }
    return sign * v;
}

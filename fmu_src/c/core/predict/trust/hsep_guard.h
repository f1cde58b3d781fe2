/* Guard against wrong measurements: missing, held, jumping or isolated values are not learned.
 *
 * Every threshold is relative to what the sensor has shown so far, or to the motion that the physics model predicts, so
 * the guard has no scale of its own. Plain data; reentrant; allocates nothing.
 */
#ifndef HSEP_GUARD_H
#define HSEP_GUARD_H

#include "hsep_api.h"
#include "hsep_held.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_GUARD_NEIGHBOURS 2 /* samples to either side that an isolated value is compared with */

typedef struct {
    uint64_t patience;          /* doubtful samples in a row after which another level is believed, */
    uint64_t patience_standing; /* and an axis that stands still */
    uint64_t gap;               /* samples since the last accepted one */
    uint64_t doubtful;          /* held or jumping samples in a row */
    uint64_t holding; /* whether the sensor may be held: the last value was equal under more motion than the axis
                                 * itself stands */
    double vibration; /* m, median change of the residual from sample to sample, beyond that of noise */
    double stood;     /* m, largest predicted motion under which the axis itself stood: it went on from there, while
                               * a sensor that was held goes on from where the axis has come to meanwhile */
    double measured, before_run; /* m, the last measured residual, and that before the run of equal values */
    double last;                 /* m, the last accepted residual */
    hsep_held held;
    double spread;    /* m, mean deviation from the neighbours' median; -1 before the first window */
    double pace;      /* m, largest predicted motion of a sample in the last window */
    double last_x_pb; /* m, the last prediction; NaN before the first */
    double before[HSEP_GUARD_NEIGHBOURS]; /* m, the last residuals, oldest first */
} hsep_guard;

HSEP_ASSERT_WORDS(hsep_guard, 18 + HSEP_GUARD_NEIGHBOURS);

typedef struct {
    enum { HSEP_NO_DOUBT = 0, HSEP_STANDS, HSEP_OTHER_LEVEL } kind;
    double value; /* m, position where the axis stands, or residual at the other level */
} hsep_doubt;

/* Np: samples of a usual window; T_s: s. */
HSEP_API void hsep_guard_init(hsep_guard *self, uint64_t Np, double T_s);

/* Judge the samples of a window: accepted, (n,), becomes 1 where a sample is plausible and 0 elsewhere;
 * suspect, (n,), 1 where a sample may be of a held sensor, believed or not: equal under a predicted motion.
 * x: (n,) m, measured, NaN where missing; x_pb: (n,) m; largest: m, the largest accepted residual so far;
 * deviation: (n,) work. Signals are newest first: sample k is at place n - 1 - k. Cost: about 60 + 2 log2(n) operations
 * a sample, and n more where a run of held values ends. */
HSEP_API void hsep_guard_accept(
    hsep_guard *self, const double x[], const double x_pb[], uint64_t n, double largest, double deviation[],
    double accepted[], double suspect[]);

/* What the next window may be otherwise than predicted: the axis stands still, believed or not, until it does not; or
 * the rejected level is the true one. largest: m, the largest accepted residual so far. Constant cost. */
HSEP_API hsep_doubt hsep_guard_doubt(const hsep_guard *self, double largest);

#endif

/* Detection of held measurements: a value that stays equal while the command moves the drive.
 *
 * The sensor's resolution step is estimated as the smallest change so far. Of a run of equal values only its length and
 * the range of predicted positions are kept, so a value held over many windows is detected in each of them, also at
 * rest once the drive has moved. Plain data; reentrant; constant cost.
 */
#ifndef HSEP_HELD_H
#define HSEP_HELD_H

#include "hsep_api.h"
#include "hsep_layout.h"

typedef struct {
    double value;     /* m, the last measurement; NaN before the first */
    double repeats;   /* length of the run of equal values */
    double low, high; /* m, range of predicted positions over the run */
    double step;      /* m, the smallest change so far; infinite before the first */
} hsep_held;

HSEP_ASSERT_WORDS(hsep_held, 5);

HSEP_API void hsep_held_init(hsep_held *self);

/* Process a measurement and its prediction, m; return whether it is held. still: m, predicted motion within which equal
 * values are plausible whatever the resolution. */
HSEP_API int hsep_held_holds(hsep_held *self, double x_meas, double x_pb, double still);

/* Whether the last value has been equal under a predicted motion, m; first_step: m, resolution assumed before the first
 * change; the rest as above. */
HSEP_API int hsep_held_stays(const hsep_held *self, double motion, double still, double first_step);

#endif

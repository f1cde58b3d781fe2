/* Tells samples without measurement: a value that is held while the command moves the drive.
 *
 * The sensor's step is the smallest change it has ever shown. Of a run of equal values nothing but its length and the
 * range of predicted positions over it is kept, so a value that is held over many windows is recognised in each of
 * them, at rest too, once the drive has moved. Plain data; reentrant; constant cost.
 */
#ifndef HSEP_SENSOR_H
#define HSEP_SENSOR_H

#include "hsep_api.h"
#include "hsep_layout.h"

typedef struct {
    double value;     /* m, the last one; NaN before the first */
    double repeats;   /* how often it came in a row */
    double low, high; /* m, predicted positions meanwhile */
    double step;      /* m, the smallest change ever; infinite before the first */
} hsep_sensor;

HSEP_ASSERT_WORDS(hsep_sensor, 5);

HSEP_API void hsep_sensor_init(hsep_sensor *self);

/* Take in a measurement and the prediction of it, m; return whether it is no measurement. */
HSEP_API int hsep_sensor_misses(hsep_sensor *self, double x_meas, double x_pb);

#endif

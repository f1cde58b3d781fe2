/* Sampling of a look-ahead's inputs: latched at the instants within a communication step, executed in the step that
 * reaches the next instant. Plain data; reentrant.
 *
 *     if (hsep_inputs_count(context, &inputs, x_d_ahead, x_meas, x_load, may_miss, t, h, &step, message) !=
 *         HSEP_REFUSED)
 *         while (hsep_inputs_next(&inputs, &step)) { execute the sample x_d_ahead, x_meas, x_load of inputs }
 */
#ifndef HSEP_INPUTS_H
#define HSEP_INPUTS_H

#include "hsep_api.h"
#include "hsep_clock.h"
#include "hsep_layout.h"
#include "hsep_model.h"

/* The clock is begun by hsep_check_clock, the inputs where the drive rests. */
typedef struct {
    hsep_clock clock;
    double x_d_ahead, x_meas, x_load; /* m, of the sample in progress */
    double nothing;                   /* what follows the struct begins at a multiple of 16 bytes */
} hsep_inputs;

HSEP_ASSERT_WORDS(hsep_inputs, 9);

/* What the importer has set for a step: an input and its time derivative. */
typedef struct {
    double value; /* m */
    double slope; /* m/s */
} hsep_input;

/* A step in progress. */
typedef struct {
    hsep_clock_step counted;
    hsep_input x_d_ahead, x_meas;
    double x_load;                 /* m, constant over the step */
    int64_t n_latched, n_executed; /* of the instants that the step has */
    int pending;                   /* whether the inputs of the next sample are latched */
} hsep_inputs_step;

/* Count a step from t by h, s, and check the inputs that it latches; self is unchanged. may_miss: whether x_meas may be
 * NaN, which is missing. Fails if one of them cannot be taken in, or t and h do not fit. HSEP_WARNED_LATE: an instant
 * is no communication point; HSEP_WARNED_MOVED: one was taken at a point beside it; or both. */
HSEP_API hsep_status hsep_inputs_count(
    const hsep_context *context, const hsep_inputs *self, hsep_input x_d_ahead, hsep_input x_meas, double x_load,
    int may_miss, double t, double h, hsep_inputs_step *step, char message[]);

/* Go on in a counted step: return 1 with the next sample to execute in x_d_ahead and x_meas, 0 when the step is
 * done. */
HSEP_API int hsep_inputs_next(hsep_inputs *self, hsep_inputs_step *step);

#endif

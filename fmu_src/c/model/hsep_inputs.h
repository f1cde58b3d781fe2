/* The inputs of a look-ahead and when they count: read at the first sub-step of a sample, used after its last one.
 * Plain data; reentrant. */
#ifndef HSEP_INPUTS_H
#define HSEP_INPUTS_H

#include "hsep_api.h"
#include "hsep_clock.h"
#include "hsep_model.h"

typedef struct {
    hsep_clock clock;
    double x_d_ahead, x_meas; /* m, of the sample in progress */
} hsep_inputs;

/* Begin at t_start, s, with the drive at rest at start, m. Fails if one of them is not finite, or the
 * start is further out than any machine is. */
HSEP_API hsep_status hsep_inputs_init(hsep_inputs *self, double t_start, double T_s, double start, char message[]);

/* Take in a communication step from t by h, s, with its inputs, m; complete tells whether it was the last one of its
 * sample. Fails, with nothing changed, if an input cannot be taken in, or t and h do not fit. */
HSEP_API hsep_status hsep_inputs_step(
    hsep_inputs *self, double x_d_ahead, double x_meas, double t, double h, int *complete, char message[]);

/* Whether inputs that were read from a state count samples of T_s, s, within their bounds, and are at sample k. */
HSEP_API int hsep_inputs_valid(const hsep_inputs *self, double T_s, uint64_t k);

#endif

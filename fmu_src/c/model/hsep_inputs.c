#include "hsep_inputs.h"

#include "hsep_check.h"

#include <math.h>

/* The input at an instant, s after the step's start. */
static double inputs_at(hsep_input input, double after)
{
    return input.slope == 0.0 ? input.value : input.value + input.slope * after;
}

/* When the last of a step's inputs is latched, s after its start. */
static double inputs_last(const hsep_clock_step *counted)
{
    return counted->first + (double)(counted->n_latched - 1) * counted->after.T_s;
}

HSEP_API hsep_status hsep_inputs_count(
    const hsep_context *context, const hsep_inputs *self, hsep_input x_d_ahead, hsep_input x_meas, double x_load,
    int may_miss, double t, double h, hsep_inputs_step *step, char message[])
{
    *step = (hsep_inputs_step){
        .x_d_ahead = x_d_ahead, .x_meas = x_meas, .x_load = x_load, .pending = hsep_clock_latched(&self->clock)};
    if (hsep_check_step(&self->clock, t, h, &step->counted, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (step->counted.n_latched == 0) {
        return hsep_check_moved(&step->counted, message);
    }
    /* Inputs are linear in time, so the first and the last one bound them all. */
    const double after[2] = {step->counted.first, inputs_last(&step->counted)};
    const double sample = (double)(self->clock.k + step->pending);
    if (hsep_check_position(context, "x_load", x_load, " at sample %.0f", sample, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    for (int i = 0; i < 2; i++) {
        const double ahead = inputs_at(x_d_ahead, after[i]), measured = inputs_at(x_meas, after[i]);
        const int missing = may_miss && isnan(measured);
        if (hsep_check_position(context, "x_d_ahead", ahead, " at sample %.0f", sample, message) != HSEP_OK ||
            (!missing &&
             hsep_check_position(context, "x_meas", measured, " at sample %.0f", sample, message) != HSEP_OK)) {
            return HSEP_REFUSED;
        }
    }
    const hsep_status status = hsep_check_moved(&step->counted, message);
    if (step->counted.inside) {
        hsep_message_add(
            message,
            "the step from %.9g s by %.9g s contains sampling instants of T_s = %g s between its ends: x_meas is read "
            "up to "
            "%g s late, so a closed loop needs steps of T_s",
            t, h, self->clock.T_s, fmin(after[1], h));
        return status == HSEP_OK ? HSEP_WARNED_LATE : HSEP_WARNED_BOTH;
    }
    return status;
}

HSEP_API int hsep_inputs_next(hsep_inputs *self, hsep_inputs_step *step)
{
    if (!step->pending && step->n_latched < step->counted.n_latched) {
        const double after = step->counted.first + (double)step->n_latched * self->clock.T_s;
        self->x_d_ahead = inputs_at(step->x_d_ahead, after);
        self->x_meas = inputs_at(step->x_meas, after);
        self->x_load = step->x_load;
        step->pending = 1;
        step->n_latched++;
    }
    if (step->n_executed < step->counted.n_samples) {
        step->pending = 0;
        self->clock.k++;
        step->n_executed++;
        return 1;
    }
    self->clock = step->counted.after;
    return 0;
}

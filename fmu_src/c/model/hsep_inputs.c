#include "hsep_inputs.h"

#include "hsep_check.h"
#include "hsep_state.h"

#include <math.h>

static const double inputs_position_max = 1e3; /* m */

HSEP_API hsep_status hsep_inputs_init(hsep_inputs *self, double t_start, double T_s, double start, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    if (hsep_check_start_time(t_start, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!isfinite(start)) {
        hsep_message_add(
            message, "the start value of x_d_ahead must be finite, got %s", hsep_number(number, start, HSEP_REAL));
        return HSEP_REFUSED;
    }
    if (fabs(start) > inputs_position_max) {
        hsep_message_add(
            message, "the start value of x_d_ahead must be within " HSEP_PLUS_MINUS "%g m, got %g", inputs_position_max,
            start);
        return HSEP_REFUSED;
    }
    hsep_clock_init(&self->clock, t_start, T_s);
    self->x_d_ahead = self->x_meas = start;
    return HSEP_OK;
}

/* Refuse a position, m, that is not finite, or further out than any machine is. */
static hsep_status inputs_check(const hsep_clock *clock, const char *name, double value, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    if (fabs(value) <= inputs_position_max) {
        return HSEP_OK;
    }
    if (isfinite(value)) {
        hsep_message_add(
            message, "%s must be within " HSEP_PLUS_MINUS "%g m, got %g at sample %.0f", name, inputs_position_max, value,
            (double)clock->k);
    } else {
        hsep_message_add(
            message, "%s must be finite, got %s at sample %.0f", name, hsep_number(number, value, HSEP_REAL),
            (double)clock->k);
    }
    return HSEP_REFUSED;
}

HSEP_API hsep_status hsep_inputs_step(
    hsep_inputs *self, double x_d_ahead, double x_meas, double t, double h, int *complete, char message[])
{
    int64_t parts = 0;
    if (hsep_check_step(&self->clock, t, h, &parts, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (self->clock.done == 0) { /* a sample begins: its inputs are read */
        if (inputs_check(&self->clock, "x_d_ahead", x_d_ahead, message) != HSEP_OK ||
            inputs_check(&self->clock, "x_meas", x_meas, message) != HSEP_OK) {
            return HSEP_REFUSED;
        }
        self->x_d_ahead = x_d_ahead;
        self->x_meas = x_meas;
    }
    *complete = hsep_clock_advance(&self->clock, parts);
    return HSEP_OK;
}

HSEP_API int hsep_inputs_valid(const hsep_inputs *self, double T_s, uint64_t k)
{
    return hsep_state_clock_valid(&self->clock) && self->clock.T_s == T_s && (uint64_t)self->clock.k == k;
}

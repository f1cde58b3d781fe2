/* Motion before a run, estimated from its first window; as predict/averaging/start.py, which says how. Positions are
 * relative to the start, signals newest first. */
#ifndef HSEP_START_H
#define HSEP_START_H

#include "hsep_physics.h"
#include "hsep_window.h"
#include "hsep_predict_constants.h"
#include "hsep_regression.h"

typedef struct {
    hsep_int Np, n;             /* samples measured and predicted */
    hsep_int n_states;          /* of the modes */
    hsep_int dead_time;         /* samples */
    hsep_int states;            /* (n_states + dead_time,) state of a motion by one metre a sample */
    hsep_int state;             /* (n_states + dead_time,) m, the one that is tried */
    hsep_int response;          /* (n + Np,) m, to it, oldest first */
    hsep_int responses;         /* (n_states, n) to each state of only the modes, oldest first */
    hsep_int weights;           /* (n_states,) m, change of the state */
    hsep_int trial, regression; /* the physics model on its own; least squares */
} hsep_start;
HSEP_ASSERT_WORDS(hsep_start, 11);

static inline hsep_real hsep_start_lay_out(hsep_start *self, const hsep_predictor_parameters *parameters)
{
    const hsep_int n_modes = parameters->n_modes, dead_time = parameters->settings.dead_time;
    const hsep_real Np = (hsep_real)parameters->settings.Np, n = (hsep_real)hsep_predicted(parameters);
    const hsep_real n_states = 2.0 * (hsep_real)n_modes, all = n_states + (hsep_real)dead_time;
    hsep_real end = HSEP_WORDS(hsep_start);
    self->Np = parameters->settings.Np;
    self->n = hsep_predicted(parameters);
    self->n_states = 2 * n_modes;
    self->dead_time = dead_time;
    self->states = hsep_take(&end, all);
    self->state = hsep_take(&end, all);
    self->response = hsep_take(&end, n + Np);
    self->responses = hsep_take(&end, n_states * n);
    self->weights = hsep_take(&end, n_states);
    self->trial = hsep_take_block(&end, hsep_physics_lay_out(&(hsep_physics){0}, parameters));
    self->regression = hsep_take_block(&end, hsep_regression_size(self->n_states));
    return end * sizeof(hsep_real);
}

/* Fill the block, which is 0. */
static inline void hsep_start_init(hsep_start *self, const hsep_predictor_parameters *parameters)
{
    const hsep_predictor_settings *settings = &parameters->settings;
    (void)hsep_start_lay_out(self, parameters);
    hsep_real *states = hsep_at(self, self->states), *within = states + self->n_states;
    const hsep_real late = (hsep_real)(settings->dead_time + (self->n - self->Np)); /* samples */
    for (hsep_int i = 0; i < parameters->n_modes; i++) {
        /* z'' + 2 zeta omega z' + omega^2 z = v t has the solution omega^2 z = v t - 2 zeta v / omega, in the state
         * (omega^2 z, omega z'). */
        const hsep_real omega = HSEP_TWO_PI * parameters->modes[i].f_n, v = 1.0 / settings->T_s;
        states[2 * i] = -late - 2.0 * parameters->modes[i].zeta * v / omega;
        states[2 * i + 1] = v / omega;
    }
    for (hsep_int i = 0; i < self->dead_time; i++) {
        within[i] = (hsep_real)i - late;
    }
    hsep_physics_init(hsep_part(self, self->trial), parameters);
    hsep_regression_init(hsep_part(self, self->regression), self->n_states, HSEP_START_DAMPING);
}

/* Response x_pb, (count,), m, to the state that is tried, and to a command that comes to 0 by step m a late sample. */
static inline void start_respond(hsep_start *self, hsep_real step, hsep_real x_pb[], hsep_int count)
{
    hsep_physics *trial = hsep_part(self, self->trial);
    const hsep_int late = self->n - self->Np;
    hsep_physics_begin(trial, hsep_at(self, self->state));
    for (hsep_int k = 0; k < count; k++) {
        x_pb[k] = hsep_physics_respond(trial, k < late ? -step * (hsep_real)(late - k) : 0.0);
    }
}

/* First step of the commands, m; 0 if the axis begins at rest, as far as they tell. */
static inline hsep_real start_step(const hsep_start *self, const hsep_real x_d[])
{
    const hsep_int late = self->n - self->Np, first = self->n - 1 - late;
    const hsep_real step = first > 0 ? x_d[first - 1] - x_d[first] : 0.0;
    return hsep_fabs(step) > HSEP_START_MOVING * hsep_largest_step(x_d, first + 1) ? step : 0.0;
}

/* Whether the commands of the first window, (n,), m, begin in motion. */
static inline int hsep_start_moves(const hsep_start *self, const hsep_real x_d[])
{
    return hsep_fabs(start_step(self, x_d)) > 0.0;
}

/* Fold the residuals that the motion leaves, and the responses to the states, into the regression. */
static inline void start_fold(hsep_start *self, const hsep_real e[])
{
    hsep_regression *regression = hsep_part(self, self->regression);
    const hsep_real *response = hsep_at(self, self->response), *responses = hsep_at(self, self->responses);
    hsep_regression_init(regression, self->n_states, HSEP_START_DAMPING);
    for (hsep_int k = 0; k < self->Np; k++) {
        hsep_real *row = hsep_regression_row(regression);
        const hsep_real measured = e[self->Np - 1 - k];
        if (isfinite(measured)) {
            for (hsep_int i = 0; i < self->n_states; i++) {
                row[i] = responses[i * self->n + k];
            }
            row[self->n_states] = measured - response[k];
            hsep_regression_fold(regression);
        }
    }
    hsep_regression_solve(regression, hsep_at(self, self->weights));
}

/* Whether the run began in motion: x_d: (n,), m, commands of its first window; e: (Np,), m, measured residuals of its
 * first samples relative to what was predicted, NaN where missing. Cost: 6 n n_states^2 multiply-adds, once. */
static inline int hsep_start_estimate(hsep_start *self, const hsep_real x_d[], const hsep_real e[])
{
    const hsep_int all = self->n_states + self->dead_time;
    const hsep_real step = start_step(self, x_d);
    hsep_real *state = hsep_at(self, self->state), *response = hsep_at(self, self->response);
    hsep_real seen = 0.0, left = 0.0;
    hsep_int known = 0;
    for (hsep_int k = self->n - self->Np; k < self->Np; k++) {
        known += isfinite(e[self->Np - 1 - k]) ? 1 : 0;
    }
    if (!hsep_start_moves(self, x_d) || known < HSEP_START_SAMPLES * self->n_states) {
        return 0;
    }
    for (hsep_int i = 0; i < self->n_states; i++) {
        hsep_zero(state, all);
        state[i] = 1.0;
        start_respond(self, 0.0, hsep_at(self, self->responses) + i * self->n, self->n);
    }
    for (hsep_int i = 0; i < all; i++) {
        state[i] = step * hsep_at(self, self->states)[i];
    }
    start_respond(self, step, response, self->n);
    for (hsep_int k = 0; k < self->Np; k++) {
        const hsep_real measured = e[self->Np - 1 - k], rest = measured - response[k];
        seen += isfinite(measured) ? measured * measured : 0.0;
        left += isfinite(measured) ? rest * rest : 0.0;
    }
    if (!(left < seen)) {
        return 0;
    }
    start_fold(self, e);
    hsep_axpy(state, 1.0, hsep_at(self, self->weights), self->n_states);
    start_respond(self, step, response, self->n + self->Np);
    return 1;
}

/* After that: add the motion to commands and physics-based prediction of the window, (n,), m, to the prediction of the
 * Np samples after it, oldest first, and to the state of the physics model after all of these. */
static inline void hsep_start_apply(
    const hsep_start *self, hsep_real x_d[], hsep_real x_pb[], hsep_real ahead[], hsep_physics *physics)
{
    const hsep_int late = self->n - self->Np;
    const hsep_real *response = hsep_at_const(self, self->response);
    const hsep_real step = late + 1 < self->n ? x_d[self->n - 2 - late] - x_d[self->n - 1 - late] : 0.0;
    for (hsep_int k = 0; k < late; k++) {
        x_d[self->n - 1 - k] -= step * (hsep_real)(late - k);
    }
    for (hsep_int k = 0; k < self->n; k++) {
        x_pb[self->n - 1 - k] += response[k];
    }
    hsep_axpy(ahead, 1.0, response + self->n, self->Np);
    hsep_physics_add(physics, hsep_part_const(self, self->trial));
}

#endif

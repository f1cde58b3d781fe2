#include "hsep_compensator.h"

#include "hsep_range.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static hsep_planner *compensator_planner(hsep_compensator *self)
{
    return (hsep_planner *)hsep_at(self, self->planner);
}

HSEP_API hsep_predictor *hsep_compensator_predictor(hsep_compensator *self)
{
    return (hsep_predictor *)hsep_at(self, self->predictor);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double compensator_lay_out(hsep_compensator *self, const hsep_compensator_parameters *parameters)
{
    const hsep_predictor_parameters *predictor = &parameters->predictor;
    const double preview = (double)predictor->preview;
    double end = HSEP_WORDS(hsep_compensator);
    self->compensate = (uint64_t)parameters->compensate;
    self->x_dm = hsep_take(&end, (double)predictor->settings.Np);
    self->trial_x = hsep_take(&end, preview + (double)predictor->settings.q);
    self->trial_e = hsep_take(&end, preview + (double)predictor->settings.p);
    self->target = hsep_take(&end, preview);
    self->spline_pb = hsep_take(&end, preview);
    self->spline_h = hsep_take(&end, preview);
    self->trial = hsep_take_block(&end, hsep_physics_size(predictor->n_modes, predictor->settings.dead_time));
    self->planner = hsep_take_block(&end, hsep_planner_size(&parameters->planner));
    self->predictor = hsep_take_block(&end, hsep_predictor_size(predictor));
    return end * sizeof(double);
}

HSEP_API double hsep_compensator_size(const hsep_compensator_parameters *parameters)
{
    return compensator_lay_out(&(hsep_compensator){0}, parameters);
}

HSEP_API void hsep_compensator_init(hsep_compensator *self, const hsep_compensator_parameters *parameters, double start)
{
    const hsep_predictor_parameters *predictor = &parameters->predictor;
    memset(self, 0, (size_t)hsep_compensator_size(parameters));
    (void)compensator_lay_out(self, parameters);
    hsep_predictor_init(hsep_compensator_predictor(self), predictor, start);
    hsep_planner_init(compensator_planner(self), &parameters->planner, start);
    /* The spline filtered by the physics model from rest, which is constant. */
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    double *spline = hsep_at(self, self->spline_pb);
    hsep_physics_init(
        trial, predictor->modes, predictor->n_modes, predictor->settings.dead_time, predictor->settings.T_s,
        (hsep_hold)predictor->settings.input_hold);
    memcpy(
        spline, hsep_splines_shape(hsep_planner_splines(compensator_planner(self))),
        (size_t)(4 * parameters->planner.spacing) * sizeof(double));
    hsep_physics_forced_response(trial, spline, spline, (size_t)predictor->preview);
}

HSEP_API int hsep_compensator_valid(const void *block, const hsep_compensator_parameters *parameters, uint64_t k)
{
    const hsep_predictor_parameters *predictor = &parameters->predictor;
    hsep_compensator got;
    hsep_predictor online;
    memcpy(&got, block, sizeof got);
    (void)compensator_lay_out(&got, parameters); /* changes nothing where it is sound */
    memcpy(&online, hsep_at_bytes(block, got.predictor), sizeof online);
    return memcmp(&got, block, sizeof got) == 0 && got.state <= HSEP_SEP_HYBRID && got.solving <= 1 &&
           (got.solving || online.n_published == predictor->settings.Np) &&
           (online.divergence ||
            hsep_within(hsep_at_bytes(block, got.x_dm), predictor->settings.Np, HSEP_PREDICTION_MAX)) &&
           hsep_physics_valid(hsep_at_bytes(block, got.trial), predictor->n_modes, predictor->settings.dead_time) &&
           hsep_planner_valid(hsep_at_bytes(block, got.planner), &parameters->planner) &&
           hsep_predictor_valid(hsep_at_bytes(block, got.predictor), predictor, k);
}

/* target := x_d - the model's response to x_d with the decided part of delta; eq. (3) without a matrix. */
static void compensator_target(hsep_compensator *self, hsep_sep_state state)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_planner *planner = compensator_planner(self);
    const hsep_features *f = &predictor->features;
    const uint64_t preview = predictor->preview, Np = predictor->Np;
    const double *x_d = hsep_at(predictor, predictor->x_d);
    double *target = hsep_at(self, self->target);
    double *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    memcpy(trial, hsep_predictor_physics(predictor), (size_t)(self->planner - self->trial) * sizeof(double));
    for (uint64_t k = 0; k < preview; k++) {
        const double command = x_d[k] - predictor->start + hsep_planner_decided(planner, k);
        hsep_physics_forced_response(trial, &command, &x[preview - 1 - k], 1);
        target[k] = x_d[k] - predictor->start - x[preview - 1 - k];
    }
    if (state == HSEP_SEP_HYBRID) {
        const hsep_recursion recursion = hsep_predictor_recursion(predictor, 1);
        memcpy(x + preview, hsep_at(predictor, predictor->past_x) + Np, (size_t)f->q * sizeof(double));
        memcpy(e + preview, hsep_at(predictor, predictor->past_e) + Np, (size_t)f->p * sizeof(double));
        hsep_recursion_run(&recursion, x, hsep_predictor_drive(predictor, preview), e, preview, 0, preview);
        for (uint64_t k = 0; k < preview; k++) {
            target[k] -= e[preview - 1 - k];
        }
    }
}

/* The spline filtered by the hybrid model, G_h = (1 + W_x / (1 - W_e)) G_pb as filters. */
static void compensator_filter_spline(hsep_compensator *self)
{
    const hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_recursion recursion = hsep_predictor_recursion(predictor, 0);
    const uint64_t preview = predictor->preview;
    const double *spline_pb = hsep_at(self, self->spline_pb);
    double *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    double *spline_h = hsep_at(self, self->spline_h);
    for (uint64_t k = 0; k < preview; k++) {
        x[preview - 1 - k] = spline_pb[k];
    }
    memset(x + preview, 0, (size_t)recursion.q * sizeof(double));
    memset(e + preview, 0, (size_t)recursion.p * sizeof(double));
    hsep_recursion_run(&recursion, x, NULL, e, preview, 0, preview);
    for (uint64_t k = 0; k < preview; k++) {
        spline_h[k] = spline_pb[k] + e[preview - 1 - k];
    }
}

/* Whether the hybrid model may plan the window that begins. */
static int compensator_trusts(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_recursion recursion = hsep_predictor_recursion(predictor, 0);
    return self->compensate == HSEP_SEP_HYBRID && (double)predictor->k >= predictor->n_init &&
           hsep_predictor_regression(predictor)->n_samples > 0 && self->monitor.excess <= 0.0 &&
           hsep_recursion_stable(&recursion, hsep_at(self, self->trial_e));
}

/* Set the commands of the window up to last - 1 and predict its position; eqs. (2) and (4). */
static void compensator_publish(hsep_compensator *self, uint64_t last)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const uint64_t Np = predictor->Np, first = predictor->n_published;
    const double *x_d = hsep_at(predictor, predictor->x_d);
    double *x_dm = hsep_at(self, self->x_dm), *past_x = hsep_at(predictor, predictor->past_x);
    for (uint64_t k = first; k < last; k++) {
        x_dm[k] = x_d[k] + hsep_planner_delta(compensator_planner(self), k);
        const double command = x_dm[k] - predictor->start;
        hsep_physics_forced_response(hsep_predictor_physics(predictor), &command, &past_x[Np - 1 - k], 1);
    }
    if (!hsep_within(x_dm + first, last - first, HSEP_PREDICTION_MAX)) {
        predictor->divergence = HSEP_DIVERGES_X_DM;
    }
    hsep_predictor_publish(predictor, last);
}

/* Solver steps of a bounded plan that are due before the next sample. */
static void compensator_solve(hsep_compensator *self)
{
    const hsep_predictor *predictor = hsep_compensator_predictor(self);
    const uint64_t pinned = hsep_planner_pinned(compensator_planner(self)), i = predictor->k % predictor->Np;
    const uint64_t steps = pinned > 0 ? (HSEP_INTERIOR_STEPS + pinned - 1) / pinned : HSEP_INTERIOR_STEPS;
    int done = 0;
    for (uint64_t step = 0; !done && (step < steps || i >= pinned); step++) {
        done = hsep_planner_step(compensator_planner(self));
    }
    if (done) {
        self->solving = 0;
        compensator_publish(self, predictor->Np);
    }
}

/* Begin a plan with a model; self->state: the model, or off if there is no plan. */
static hsep_plan_status compensator_try(hsep_compensator *self, hsep_sep_state state)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const uint64_t spline = state == HSEP_SEP_HYBRID ? self->spline_h : self->spline_pb;
    compensator_target(self, state);
    const hsep_plan_status status = hsep_planner_begin(
        compensator_planner(self), hsep_at(self, spline), hsep_at(self, self->target),
        hsep_at(predictor, predictor->x_d));
    self->state = (uint64_t)(status == HSEP_PLAN_FAILED ? HSEP_SEP_OFF : state);
    return status;
}

HSEP_API void hsep_compensator_begin(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    hsep_plan_status status = HSEP_PLAN_FAILED;
    hsep_predictor_begin(predictor);
    self->state = HSEP_SEP_OFF;
    if (compensator_trusts(self)) {
        compensator_filter_spline(self);
        status = compensator_try(self, HSEP_SEP_HYBRID);
    }
    if (status == HSEP_PLAN_FAILED && self->compensate != HSEP_SEP_OFF) {
        status = compensator_try(self, HSEP_SEP_PHYSICS);
    }
    predictor->n_physics = self->state == HSEP_SEP_HYBRID ? 0 : predictor->Np;
    self->solving = status == HSEP_PLAN_BOUNDED;
    compensator_publish(self, self->solving ? hsep_planner_pinned(compensator_planner(self)) : predictor->Np);
    if (predictor->n_published == 0) {
        compensator_solve(self);
    }
}

/* Finish a window, update the excess prediction error, and begin the next window. */
static void compensator_next_window(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const uint64_t Np = predictor->Np;
    /* Predictions from few rows, before the warm-up is over, are not used: they are not judged. */
    if (hsep_predictor_finish(predictor) && (double)(predictor->k - Np) >= predictor->n_init) {
        const hsep_regression *regression = hsep_predictor_regression(predictor);
        hsep_plan_monitor_observe(
            &self->monitor, hsep_at(predictor, predictor->past_e), hsep_at(predictor, predictor->e_h), Np,
            regression->residual_sum / (double)regression->n_samples);
    }
    hsep_planner_next(compensator_planner(self), hsep_at(predictor, predictor->x_d));
    hsep_compensator_begin(self);
}

HSEP_API int hsep_compensator_sample(hsep_compensator *self, double x_d_ahead, double x_meas)
{
    if (hsep_predictor_take_in(hsep_compensator_predictor(self), x_d_ahead, x_meas)) {
        compensator_next_window(self);
        return 1;
    }
    if (self->solving) {
        compensator_solve(self);
    }
    return 0;
}

HSEP_API void hsep_compensator_read(const hsep_compensator *self, hsep_compensator_outputs *outputs)
{
    const hsep_predictor *predictor = (const hsep_predictor *)hsep_at_const(self, self->predictor);
    hsep_predictor_read(predictor, &outputs->predicted);
    outputs->x_dm = hsep_at_const(self, self->x_dm)[predictor->k % predictor->Np];
    outputs->state = (hsep_sep_state)self->state;
}

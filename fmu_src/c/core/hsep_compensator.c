#include "hsep_compensator.h"

#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static hsep_physics *compensator_physics(hsep_compensator *self, uint64_t offset)
{
    return (hsep_physics *)hsep_at(self, offset);
}

static hsep_planner *compensator_planner(hsep_compensator *self)
{
    return (hsep_planner *)hsep_at(self, self->planner);
}

HSEP_API hsep_regression *hsep_compensator_regression(hsep_compensator *self)
{
    return (hsep_regression *)hsep_at(self, self->regression);
}

static uint64_t compensator_scheduled(const hsep_compensator_parameters *parameters)
{
    return parameters->v_s > 0.0 ? HSEP_SCHEDULED : 0;
}

/* Entries of phi. */
static uint64_t compensator_features(const hsep_compensator_parameters *parameters)
{
    return 2 + parameters->q + parameters->p + compensator_scheduled(parameters);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double compensator_lay_out(hsep_compensator *self, const hsep_compensator_parameters *parameters)
{
    const double Np = (double)parameters->planner.Np, preview = (double)parameters->planner.preview;
    const double p = (double)parameters->p, q = (double)parameters->q;
    const double physics = hsep_physics_size(parameters->n_modes, parameters->dead_time);
    const double regression = hsep_regression_size(compensator_features(parameters));
    double end = HSEP_WORDS(hsep_compensator);
    self->Np = parameters->planner.Np;
    self->preview = parameters->planner.preview;
    self->p = parameters->p;
    self->q = parameters->q;
    self->n_scheduled = compensator_scheduled(parameters);
    self->sign_step = parameters->v_s * parameters->T_s;
    self->best = (uint64_t)parameters->best;
    self->n_init = parameters->n_init;
    self->ahead = hsep_take(&end, preview);
    self->x_d = hsep_take(&end, preview);
    self->x_dm = hsep_take(&end, Np);
    self->x_pb = hsep_take(&end, Np);
    self->x_h = hsep_take(&end, Np);
    self->e_h = hsep_take(&end, Np + p);
    self->past_x = hsep_take(&end, Np + q);
    self->past_e = hsep_take(&end, Np + p);
    self->weights = hsep_take(&end, (double)compensator_features(parameters));
    self->signs = hsep_take(&end, preview + 2.0 * HSEP_SCHEDULE_REACH);
    self->drive = hsep_take(&end, preview);
    self->trial_x = hsep_take(&end, preview + q);
    self->trial_e = hsep_take(&end, preview + p);
    self->target = hsep_take(&end, preview);
    self->spline_pb = hsep_take(&end, preview);
    self->spline_h = hsep_take(&end, preview);
    self->physics = hsep_take_block(&end, physics);
    self->trial = hsep_take_block(&end, physics);
    self->regression = hsep_take_block(&end, regression);
    self->saved = hsep_take_block(&end, regression);
    self->planner = hsep_take_block(&end, hsep_planner_size(&parameters->planner));
    return end * sizeof(double);
}

HSEP_API double hsep_compensator_size(const hsep_compensator_parameters *parameters)
{
    hsep_compensator layout;
    return compensator_lay_out(&layout, parameters);
}

HSEP_API void hsep_compensator_init(hsep_compensator *self, const hsep_compensator_parameters *parameters, double start)
{
    memset(self, 0, (size_t)hsep_compensator_size(parameters));
    (void)compensator_lay_out(self, parameters);
    self->start = self->x_d_last = start;
    hsep_sensor_init(&self->sensor);
    for (uint64_t i = 0; i < self->preview; i++) {
        hsep_at(self, self->ahead)[i] = start;
    }
    hsep_physics *physics = compensator_physics(self, self->physics);
    hsep_physics *trial = compensator_physics(self, self->trial);
    for (int i = 0; i < 2; i++) {
        hsep_physics_init(
            i == 0 ? physics : trial, parameters->modes, parameters->n_modes, parameters->dead_time, parameters->T_s,
            parameters->hold);
    }
    hsep_regression_init(hsep_compensator_regression(self), compensator_features(parameters), parameters->lambda);
    hsep_planner_init(compensator_planner(self), &parameters->planner, start);
    /* The spline behind the physics model, at rest: it never changes. */
    double *spline = hsep_at(self, self->spline_pb);
    const uint64_t width = 4 * parameters->planner.spacing;
    memcpy(spline, hsep_planner_spline(compensator_planner(self)), (size_t)width * sizeof(double));
    hsep_physics_respond(trial, spline, spline, (size_t)self->preview);
}

HSEP_API int hsep_compensator_valid(const void *block, const hsep_compensator_parameters *parameters)
{
    hsep_compensator expected, got;
    memcpy(&got, block, sizeof got);
    expected = got; /* what may differ from a fresh block is taken over, the rest must be equal */
    (void)compensator_lay_out(&expected, parameters);
    int sound = memcmp(&expected, &got, sizeof got) == 0 && got.state <= HSEP_SEP_HYBRID && got.solving <= 1 &&
                got.predicted <= got.Np && got.k % got.Np < (got.solving ? got.predicted : got.Np) &&
                (got.solving || got.predicted == got.Np) && got.learning <= 1 && got.missing <= 1 &&
                got.divergence <= HSEP_DIVERGES_X_DM &&
                (got.divergence ||
                 hsep_within(hsep_at_bytes(block, got.ahead), 2 * got.preview + 3 * got.Np, HSEP_PREDICTION_MAX)) &&
                got.sum_e >= 0.0 && isfinite(got.sum_e) && got.sum_pb >= 0.0 && isfinite(got.sum_pb) &&
                got.sum_h >= 0.0 && isfinite(got.sum_h) &&
                hsep_planner_valid(hsep_at_bytes(block, expected.planner), &parameters->planner);
    const uint64_t physics[2] = {expected.physics, expected.trial};
    const uint64_t regression[2] = {expected.regression, expected.saved};
    for (int i = 0; i < 2 && sound; i++) {
        sound = hsep_physics_valid(hsep_at_bytes(block, physics[i]), parameters->n_modes, parameters->dead_time) &&
                hsep_regression_valid(hsep_at_bytes(block, regression[i]), compensator_features(parameters));
    }
    return sound;
}

static hsep_recursion compensator_recursion(const hsep_compensator *self, int with_bias)
{
    const double *w = hsep_at_const(self, self->weights);
    return (hsep_recursion){
        .w_x = w + 1, .w_e = w + 2 + self->q, .p = self->p, .q = self->q, .bias = with_bias ? w[0] : 0.0};
}

/* Write newest first into place what a run of n samples has to hold of the past behind its window. */
static void compensator_past(double place[], uint64_t n, const double past[], uint64_t count)
{
    memcpy(place + n, past, (size_t)count * sizeof(double));
}

/* target := x_d - the model's response to x_d with what is decided of its change; eq. (3) without a matrix. */
static void compensator_target(hsep_compensator *self, hsep_sep_state state)
{
    const uint64_t preview = self->preview, Np = self->Np;
    const double *x_d = hsep_at(self, self->x_d);
    double *target = hsep_at(self, self->target);
    double *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    hsep_physics *trial = compensator_physics(self, self->trial);
    memcpy(trial, compensator_physics(self, self->physics), (size_t)(self->regression - self->trial) * sizeof(double));
    for (uint64_t k = 0; k < preview; k++) {
        const double command = x_d[k] - self->start + hsep_planner_decided(compensator_planner(self), k);
        hsep_physics_respond(trial, &command, &x[preview - 1 - k], 1);
        target[k] = x_d[k] - self->start - x[preview - 1 - k];
    }
    if (state == HSEP_SEP_HYBRID) {
        const hsep_recursion recursion = compensator_recursion(self, 1);
        compensator_past(x, preview, hsep_at(self, self->past_x) + Np, self->q);
        compensator_past(e, preview, hsep_at(self, self->past_e) + Np, self->p);
        hsep_recursion_run(&recursion, x, hsep_at(self, self->drive), e, preview, 0, preview);
        for (uint64_t k = 0; k < preview; k++) {
            target[k] -= e[preview - 1 - k];
        }
    }
}

/* The spline behind the hybrid model, G_h = (1 + W_x / (1 - W_e)) G_pb as filters. */
static void compensator_filter_spline(hsep_compensator *self)
{
    const uint64_t preview = self->preview;
    const double *spline_pb = hsep_at(self, self->spline_pb);
    double *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    double *spline_h = hsep_at(self, self->spline_h);
    const hsep_recursion recursion = compensator_recursion(self, 0);
    for (uint64_t k = 0; k < preview; k++) {
        x[preview - 1 - k] = spline_pb[k];
    }
    memset(x + preview, 0, (size_t)self->q * sizeof(double));
    memset(e + preview, 0, (size_t)self->p * sizeof(double));
    hsep_recursion_run(&recursion, x, NULL, e, preview, 0, preview);
    for (uint64_t k = 0; k < preview; k++) {
        spline_h[k] = spline_pb[k] + e[preview - 1 - k];
    }
}

/* Whether the hybrid model may plan the window that begins. */
static int compensator_trusts(hsep_compensator *self)
{
    const hsep_regression *regression = (const hsep_regression *)hsep_at(self, self->regression);
    const hsep_recursion recursion = compensator_recursion(self, 0);
    return self->best == HSEP_SEP_HYBRID && (double)self->k >= self->n_init && regression->n_samples > 0 &&
           self->trust.excess <= 0.0 && hsep_recursion_stable(&recursion, hsep_at(self, self->trial_e));
}

/* Fix and predict the samples of the window up to last - 1; eqs. (2) and (4). */
static void compensator_predict(hsep_compensator *self, uint64_t last)
{
    const uint64_t Np = self->Np;
    const hsep_recursion recursion = compensator_recursion(self, 1);
    const double *x_d = hsep_at(self, self->x_d);
    double *x_dm = hsep_at(self, self->x_dm), *past_x = hsep_at(self, self->past_x);
    double *x_pb = hsep_at(self, self->x_pb), *x_h = hsep_at(self, self->x_h);
    double *e_h = hsep_at(self, self->e_h);
    for (uint64_t k = self->predicted; k < last; k++) {
        x_dm[k] = x_d[k] + hsep_planner_delta(compensator_planner(self), k);
        const double command = x_dm[k] - self->start;
        hsep_physics_respond(compensator_physics(self, self->physics), &command, &past_x[Np - 1 - k], 1);
        x_pb[k] = past_x[Np - 1 - k] + self->start;
    }
    hsep_recursion_run(
        &recursion, past_x, hsep_at(self, self->drive) + (self->preview - Np), e_h, Np, self->predicted, last);
    for (uint64_t k = self->predicted; k < last; k++) {
        x_h[k] = self->state == HSEP_SEP_HYBRID ? x_pb[k] + e_h[Np - 1 - k] : x_pb[k];
    }
    const uint64_t first = self->predicted, n = last - first;
    if (!hsep_within(x_dm + first, n, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_DM;
    } else if (!hsep_within(x_pb + first, n, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_PB;
    } else if (!hsep_within(x_h + first, n, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_H;
    }
    self->predicted = last;
}

/* Do what has to be done of a bounded plan before the sample that comes next. */
static void compensator_solve(hsep_compensator *self)
{
    const uint64_t pinned = hsep_planner_pinned(compensator_planner(self)), i = self->k % self->Np;
    const uint64_t steps = pinned > 0 ? (HSEP_INTERIOR_STEPS + pinned - 1) / pinned : HSEP_INTERIOR_STEPS;
    int done = 0;
    for (uint64_t step = 0; !done && (step < steps || i >= pinned); step++) {
        done = hsep_planner_step(compensator_planner(self));
    }
    if (done) {
        self->solving = 0;
        compensator_predict(self, self->Np);
    }
}

/* Take in the reference of the plan that begins: the signs of its velocity, and what they add to the residuals. */
static void compensator_schedule(hsep_compensator *self)
{
    const double *w = hsep_at(self, self->weights) + 2 + self->q + self->p;
    double *signs = hsep_at(self, self->signs), *drive = hsep_at(self, self->drive);
    double features[HSEP_SCHEDULED];
    if (self->n_scheduled == 0) {
        return;
    }
    hsep_schedule_signs(signs, hsep_at(self, self->x_d), self->preview, self->x_d_last, self->sign_step);
    for (uint64_t k = 0; k < self->preview; k++) {
        double sum = 0.0;
        hsep_schedule_features(signs, k, features);
        for (int i = 0; i < HSEP_SCHEDULED; i++) {
            sum += features[i] * w[i];
        }
        drive[self->preview - 1 - k] = sum;
    }
}

/* Plan the window that begins with the best model there is. */
static void compensator_plan(hsep_compensator *self)
{
    const uint64_t Np = self->Np, preview = self->preview, oldest = self->k % preview;
    hsep_planner *planner = compensator_planner(self);
    double *x_d = hsep_at(self, self->x_d), *ahead = hsep_at(self, self->ahead);
    memcpy(x_d, ahead + oldest, (size_t)(preview - oldest) * sizeof(double));
    memcpy(x_d + (preview - oldest), ahead, (size_t)oldest * sizeof(double));
    hsep_regression_solve(hsep_compensator_regression(self), hsep_at(self, self->weights)); /* Eq. (6) */
    compensator_past(hsep_at(self, self->e_h), Np, hsep_at(self, self->past_e) + Np, self->p);
    compensator_schedule(self);

    hsep_plan_status status = HSEP_PLAN_FAILED;
    self->state = HSEP_SEP_OFF;
    if (compensator_trusts(self)) {
        compensator_filter_spline(self);
        compensator_target(self, HSEP_SEP_HYBRID);
        status = hsep_planner_begin(planner, hsep_at(self, self->spline_h), hsep_at(self, self->target), x_d);
        self->state = status == HSEP_PLAN_FAILED ? HSEP_SEP_OFF : HSEP_SEP_HYBRID;
    }
    if (status == HSEP_PLAN_FAILED && self->best != HSEP_SEP_OFF) {
        compensator_target(self, HSEP_SEP_PHYSICS);
        status = hsep_planner_begin(planner, hsep_at(self, self->spline_pb), hsep_at(self, self->target), x_d);
        self->state = status == HSEP_PLAN_FAILED ? HSEP_SEP_OFF : HSEP_SEP_PHYSICS;
    }
    self->predicted = 0;
    self->solving = status == HSEP_PLAN_BOUNDED;
    if (!self->solving) {
        compensator_predict(self, Np);
        return;
    }
    compensator_predict(self, hsep_planner_pinned(planner));
    if (self->predicted == 0) {
        compensator_solve(self);
    }
}

/* Get ready for what is measured over the window that begins. */
static void compensator_expect(hsep_compensator *self, int measured_before)
{
    self->learning = measured_before && self->k >= self->preview; /* over the first fill there is nothing to learn */
    self->missing = 0;
    memcpy(
        hsep_at(self, self->saved), hsep_at(self, self->regression),
        (size_t)(self->saved - self->regression) * sizeof(double));
}

HSEP_API void hsep_compensator_begin(hsep_compensator *self)
{
    compensator_plan(self);
    compensator_expect(self, 1);
}

/* Fold the row of a sample, at place i of its window, into the regression; eqs. (5) and (6). */
static void compensator_learn(hsep_compensator *self, uint64_t i)
{
    const uint64_t p = self->p, q = self->q, j = self->Np - 1 - i;
    const double *x = hsep_at(self, self->past_x) + j, *e = hsep_at(self, self->past_e) + j;
    double *row = hsep_regression_row(hsep_compensator_regression(self));
    /* phi(k) = [1, x_pb(k) ... x_pb(k-q), e_pb(k-1) ... e_pb(k-p)] and the scheduled ones, its target e_pb(k) beside
     * it */
    row[0] = 1.0;
    memcpy(row + 1, x, (size_t)(q + 1) * sizeof(double));
    memcpy(row + 2 + q, e + 1, (size_t)p * sizeof(double));
    if (self->n_scheduled > 0) {
        hsep_schedule_features(hsep_at(self, self->signs), i, row + 2 + q + p);
    }
    row[2 + q + p + self->n_scheduled] = e[0];
    hsep_regression_fold(hsep_compensator_regression(self));
}

/* Finish a window: what is measured of it, or what was predicted if it was not, is the past of the next one. */
static void compensator_measured(hsep_compensator *self)
{
    const uint64_t Np = self->Np;
    double *past_x = hsep_at(self, self->past_x), *past_e = hsep_at(self, self->past_e);
    const double *e_h = hsep_at(self, self->e_h);
    hsep_regression *regression = hsep_compensator_regression(self);
    if (self->missing) {
        memcpy(regression, hsep_at(self, self->saved), (size_t)(self->saved - self->regression) * sizeof(double));
        for (uint64_t j = 0; j < Np; j++) {
            past_e[j] = self->state == HSEP_SEP_HYBRID ? e_h[j] : 0.0;
        }
    } else if (self->learning && (double)(self->k - Np) >= self->n_init) {
        /* What is predicted from a few rows before the warm-up is over moves nothing: it is not judged. */
        hsep_trust_observe(&self->trust, past_e, e_h, Np, regression->residual_sum / (double)regression->n_samples);
    }
    hsep_planner_next(compensator_planner(self), hsep_at(self, self->x_d));
    if (self->n_scheduled > 0) {
        hsep_schedule_next(hsep_at(self, self->signs), Np);
    }
    self->x_d_last = hsep_at(self, self->x_d)[Np - 1];
    memcpy(past_x + Np, past_x, (size_t)self->q * sizeof(double)); /* q < Np, p <= Np: they do not overlap */
    memcpy(past_e + Np, past_e, (size_t)self->p * sizeof(double));
}

HSEP_API void hsep_compensator_sample(hsep_compensator *self, double x_d_ahead, double x_meas)
{
    const uint64_t i = self->k % self->Np, j = self->Np - 1 - i;
    const double x_pb = hsep_at(self, self->x_pb)[i], x_h = hsep_at(self, self->x_h)[i];
    const double x_d = hsep_at(self, self->x_d)[i];
    hsep_at(self, self->ahead)[self->k % self->preview] = x_d_ahead;
    hsep_at(self, self->past_e)[j] = x_meas - self->start - hsep_at(self, self->past_x)[j];
    if (hsep_sensor_misses(&self->sensor, x_meas, x_pb)) {
        self->missing = 1;
    }
    if (self->learning && !self->missing) {
        compensator_learn(self, i);
    }
    if (self->k >= self->preview && (double)self->k >= self->n_init) {
        self->n_measured++;
        self->sum_e += (x_meas - x_d) * (x_meas - x_d);
        self->sum_pb += (x_meas - x_pb) * (x_meas - x_pb);
        self->sum_h += (x_meas - x_h) * (x_meas - x_h);
    }
    self->k++;
    if (self->k % self->Np == 0) {
        compensator_measured(self);
        compensator_plan(self);
        compensator_expect(self, !self->missing);
    } else if (self->solving) {
        compensator_solve(self);
    }
}

static double compensator_rms(const hsep_compensator *self, double sum)
{
    return self->n_measured > 0 ? sqrt(sum / (double)self->n_measured) : 0.0;
}

HSEP_API void hsep_compensator_read(const hsep_compensator *self, hsep_compensator_outputs *outputs)
{
    const uint64_t i = self->k % self->Np;
    outputs->x_d = hsep_at_const(self, self->x_d)[i];
    outputs->x_dm = hsep_at_const(self, self->x_dm)[i];
    outputs->x_pb = hsep_at_const(self, self->x_pb)[i];
    outputs->x_h = hsep_at_const(self, self->x_h)[i];
    outputs->rms_e = compensator_rms(self, self->sum_e);
    outputs->rms_pb = compensator_rms(self, self->sum_pb);
    outputs->rms_h = compensator_rms(self, self->sum_h);
    outputs->batch = self->k / self->Np;
    outputs->state = (hsep_sep_state)self->state;
}

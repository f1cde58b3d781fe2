#include "hsep_predictor.h"

#include "hsep_range.h"
#include "hsep_reference_features.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

HSEP_API hsep_recursion hsep_predictor_recursion(const hsep_predictor *self, int with_bias)
{
    const hsep_features *f = &self->features;
    const double *w = hsep_at_const(self, self->weights);
    return (hsep_recursion){
        .w_x = w + f->x, .w_e = w + f->e, .p = f->p, .q = f->q, .bias = with_bias ? w[HSEP_BIAS] : 0.0};
}

HSEP_API const double *hsep_predictor_drive(const hsep_predictor *self, uint64_t n)
{
    const int has_reference = self->features.n > self->features.reference;
    return has_reference ? hsep_at_const(self, self->drive) + (self->preview - n) : NULL;
}

static const uint64_t predictor_parts = 5;       /* samples over which the prediction of a window is spread */
static const double predictor_first_step = 1e-5; /* m, resolution of the sensor assumed before its first change */
static const double predictor_still = 1e-8;      /* m, motion below which the drive counts as at rest */

/* Guard before a row is learned: return whether it is. A measurement held while the drive moves is missing; with trust
 * a window is learned when it has ended. */
static int predictor_guard(hsep_predictor *self, double x_meas, double x_pb)
{
    if (self->saved && hsep_sensor_misses(&self->sensor, x_meas, x_pb, predictor_still, predictor_first_step)) {
        self->missing = 1;
    }
    return self->learning && !self->missing && !self->trusted;
}

/* Fold the row of sample i of its window into the regression; eqs. (5) and (6). */
static void predictor_learn(hsep_predictor *self, uint64_t i)
{
    const hsep_features *f = &self->features;
    const uint64_t j = self->n - 1 - i;
    const double *x = hsep_at(self, self->past_x) + j, *e = hsep_at(self, self->past_e) + j;
    double *row = hsep_regression_row(hsep_predictor_regression(self)); /* phi(k), its target e_pb(k) behind it */
    row[HSEP_BIAS] = 1.0;
    memcpy(row + f->x, x, (size_t)(f->q + 1) * sizeof(double));
    memcpy(row + f->e, e + 1, (size_t)f->p * sizeof(double));
    if (f->n > f->reference) {
        hsep_reference_features_at(hsep_at(self, self->signs), i, row + f->reference);
    }
    row[f->n] = e[0];
    hsep_regression_fold(hsep_predictor_regression(self));
}

/* Whether the work for a comparison of the window is done with its sample i: the last one that does not end it, when a
 * compensator has planned. */
static int predictor_doubts(const hsep_predictor *self, uint64_t i)
{
    return self->trusted && i + 2 == (self->Np > 2 ? self->Np : 2);
}

HSEP_API int hsep_predictor_take_in(hsep_predictor *self, double x_d_ahead, double x_meas)
{
    const uint64_t i = self->k % self->Np, j = self->n - 1 - i, late = self->late;
    /* What was measured is that of late samples ago. */
    const double x_d = hsep_at(self, self->x_d - late)[i], x_pb = hsep_at(self, self->x_pb - late)[i];
    const double x_h = hsep_at(self, self->x_h - late)[i], x_hold = hsep_at(self, self->x_hold - late)[i];
    hsep_at(self, self->ahead)[self->k % self->preview] = x_d_ahead;
    hsep_at(self, self->past_e)[j] = x_meas - self->start - hsep_at(self, self->past_x)[j]; /* e_pb = x - x_pb */
    if (self->trusted) {
        hsep_trusted_measure(hsep_predictor_trusted(self), i, x_meas - self->start);
    }
    if (predictor_doubts(self, i)) {
        hsep_trusted_doubt(hsep_predictor_trusted(self), hsep_at(self, self->past_e) + self->n);
    }
    if (predictor_guard(self, x_meas, x_pb)) {
        predictor_learn(self, i);
    }
    if (self->k >= self->preview + late && !isnan(x_meas)) {
        self->residual = x_meas - x_pb;
    }
    if (self->k >= self->preview + late && (double)self->k >= self->n_init + (double)late && !isnan(x_meas)) {
        self->n_measured++;
        self->sum_e += (x_meas - x_d) * (x_meas - x_d);
        self->sum_pb += (x_meas - x_pb) * (x_meas - x_pb);
        self->sum_h += (x_meas - x_h) * (x_meas - x_h);
        self->sum_hold += (x_meas - x_hold) * (x_meas - x_hold);
    }
    self->k++;
    return i + 1 == self->Np;
}

/* Unlearn the window: restore the regression, and replace the residuals by their predictions. */
static void predictor_unlearn(hsep_predictor *self)
{
    const double *e_h = hsep_at(self, self->e_h);
    double *past_e = hsep_at(self, self->past_e);
    memcpy(
        hsep_at(self, self->regression), hsep_at(self, self->saved),
        (size_t)(self->saved - self->regression) * sizeof(double));
    for (uint64_t i = 0, j = self->Np; j-- > 0; i++) {
        past_e[j] = i < self->n_physics ? 0.0 : e_h[j];
    }
}

/* Correct the state at the beginning of the run, if its first residuals tell that it was in motion. */
static void predictor_start(hsep_predictor *self)
{
    const uint64_t Np = self->Np, late = self->late;
    hsep_start *motion = (hsep_start *)hsep_at(self, self->motion);
    hsep_uncertainty *uncertainty = hsep_predictor_uncertainty(self);
    hsep_trusted *trusted = hsep_predictor_trusted(self);
    double *command = hsep_at(self, self->command), *past_x = hsep_at(self, self->past_x);
    double *e = hsep_at(self, self->past_e) + late, *work = hsep_at(trusted, trusted->x);
    const double *e_h = hsep_at(uncertainty, uncertainty->e_h) + late;
    for (uint64_t j = 0; j < Np; j++) {
        work[j] = e[j] - e_h[j];
    }
    if (hsep_start_estimate(motion, command, work)) {
        for (uint64_t j = 0; j < Np; j++) {
            e[j] += past_x[late + j];
        }
        hsep_start_apply(motion, command, past_x, hsep_at(self, self->ahead_pb), hsep_predictor_physics(self));
        for (uint64_t j = 0; j < Np; j++) {
            e[j] -= past_x[late + j];
        }
        hsep_trusted_begin_in_motion(trusted, command + late, past_x + late);
    }
}

/* Learn the measured window: by the residual model that can be trusted, and its errors. A first fill that was predicted
 * is not learned, but is what comes before. */
static void predictor_learn_window(hsep_predictor *self)
{
    hsep_trusted *trusted = hsep_predictor_trusted(self);
    double *past_e = hsep_at(self, self->past_e) + self->late;
    if (self->motion && self->k == self->preview + self->Np) {
        predictor_start(self);
    }
    if (trusted != NULL && (self->learning || self->preview > self->Np)) {
        hsep_trusted_learn(
            trusted, hsep_at(self, self->command) + self->late, hsep_at(self, self->past_x) + self->late, past_e,
            self->learning != 0);
    }
    if (self->learning && !self->missing) {
        hsep_uncertainty_learn(
            hsep_predictor_uncertainty(self), past_e, trusted != NULL ? hsep_at(trusted, trusted->accepted) : NULL);
    }
}

HSEP_API int hsep_predictor_finish(hsep_predictor *self)
{
    const hsep_features *f = &self->features;
    const uint64_t n = self->n, late = self->late;
    double *past_x = hsep_at(self, self->past_x), *past_e = hsep_at(self, self->past_e);
    predictor_learn_window(self);
    if (self->missing) {
        predictor_unlearn(self);
    }
    if (f->n > f->reference) {
        hsep_reference_features_advance(hsep_at(self, self->signs), self->Np);
    }
    self->x_d_last = hsep_at(self, self->x_d)[self->Np - 1];
    memcpy(past_x + n, past_x + late, (size_t)f->q * sizeof(double)); /* q < Np, p <= Np: they do not overlap */
    memcpy(past_e + n, past_e + late, (size_t)f->p * sizeof(double));
    return self->learning && !self->missing;
}

/* Features of the reference over the window that begins, and their part of the residuals. */
static void predictor_reference(hsep_predictor *self)
{
    const double *w = hsep_at(self, self->weights) + self->features.reference;
    double *signs = hsep_at(self, self->signs), *drive = hsep_at(self, self->drive);
    double features[HSEP_N_REFERENCE];
    hsep_reference_features_signs(signs, hsep_at(self, self->x_d), self->preview, self->x_d_last, self->sign_step);
    for (uint64_t k = 0; k < self->preview; k++) {
        double sum = 0.0;
        hsep_reference_features_at(signs, k, features);
        for (int i = 0; i < HSEP_N_REFERENCE; i++) {
            sum += features[i] * w[i];
        }
        drive[self->preview - 1 - k] = sum;
    }
}

/* Weights for the window that begins, eq. (6), and the part of the features of the reference. */
static void predictor_solve(hsep_predictor *self)
{
    if (self->trusted) {
        return;
    }
    hsep_regression_solve(hsep_predictor_regression(self), hsep_at(self, self->weights));
    if (self->features.n > self->features.reference) {
        predictor_reference(self);
    }
}

/* Keep the samples of the window that are not measured yet, before the next one. */
static void predictor_keep(hsep_predictor *self)
{
    const uint64_t late = self->late, signals[4] = {self->x_d, self->x_pb, self->x_h, self->x_hold};
    double *command = hsep_at(self, self->command), *past_x = hsep_at(self, self->past_x);
    memmove(command + self->Np, command, (size_t)late * sizeof(double));
    memmove(past_x + self->Np, past_x, (size_t)late * sizeof(double));
    for (int i = 0; i < 4; i++) {
        double *kept = hsep_at(self, signals[i] - late);
        memmove(kept, kept + self->Np, (size_t)late * sizeof(double));
    }
}

HSEP_API void hsep_predictor_begin(hsep_predictor *self)
{
    const uint64_t n = self->n, oldest = self->k % self->preview, newest = self->preview - oldest;
    const double *ahead = hsep_at(self, self->ahead), *past_e = hsep_at(self, self->past_e);
    double *x_d = hsep_at(self, self->x_d), *e_h = hsep_at(self, self->e_h);
    predictor_keep(self);
    memcpy(x_d, ahead + oldest, (size_t)newest * sizeof(double));
    memcpy(x_d + newest, ahead, (size_t)oldest * sizeof(double));
    if (e_h != past_e) {
        memcpy(e_h + n, past_e + n, (size_t)self->features.p * sizeof(double));
    }
    predictor_solve(self);
    self->n_published = 0;
    self->held = self->residual;
    self->learning = !self->missing && self->k >= self->preview; /* the first fill is not learned */
    self->missing = 0;
    if (self->saved) {
        memcpy(
            hsep_at(self, self->saved), hsep_at(self, self->regression),
            (size_t)(self->saved - self->regression) * sizeof(double));
    }
}

/* Guard before the samples first ... last - 1 are published: set divergence if one is out of range. */
static void predictor_bound(hsep_predictor *self, uint64_t first, uint64_t last)
{
    const double *x_pb = hsep_at(self, self->x_pb) + first, *x_h = hsep_at(self, self->x_h) + first;
    if (self->divergence == HSEP_CONVERGES && !hsep_within(x_pb, last - first, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_PB;
    } else if (self->divergence == HSEP_CONVERGES && !hsep_within(x_h, last - first, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_H;
    }
}

HSEP_API void hsep_predictor_publish(hsep_predictor *self, uint64_t last)
{
    const uint64_t Np = self->Np, late = self->late, first = self->n_published;
    const hsep_recursion recursion = hsep_predictor_recursion(self, 1);
    const double *past_x = hsep_at(self, self->past_x);
    double *x_pb = hsep_at(self, self->x_pb), *x_h = hsep_at(self, self->x_h), *e_h = hsep_at(self, self->e_h);
    double *x_hold = hsep_at(self, self->x_hold);
    if (!self->trusted) { /* Eq. (4) */
        hsep_recursion_run(
            &recursion, past_x, hsep_predictor_drive(self, Np), e_h, self->n, first > 0 ? late + first : 0,
            late + last);
    }
    for (uint64_t i = first; i < last; i++) {
        x_pb[i] = past_x[Np - 1 - i] + self->start;
        x_h[i] = i < self->n_physics ? x_pb[i] : x_pb[i] + e_h[Np - 1 - i]; /* Eq. (4) */
        x_hold[i] = x_pb[i] + self->held;
    }
    predictor_bound(self, first, last);
    self->n_published = last;
}

/* Samples within the warm-up, of the window and the late ones before it. */
static uint64_t predictor_warm_up(const hsep_predictor *self, uint64_t late)
{
    const double left = self->n_init - (double)(self->k - self->k % self->Np) + (double)late;
    const uint64_t n = self->Np + late;
    return left >= (double)n ? n : left > 0.0 ? (uint64_t)left : 0;
}

HSEP_API uint64_t hsep_predictor_warm_up(const hsep_predictor *self) { return predictor_warm_up(self, 0); }

HSEP_API void hsep_predictor_doubt(hsep_predictor *self, uint64_t first, uint64_t last)
{
    hsep_trusted *trusted = hsep_predictor_trusted(self);
    const hsep_uncertainty_signals signals = {
        .x_d = hsep_at(self, self->command),
        .x_pb = hsep_at(self, self->past_x),
        .e_h = hsep_at(self, self->e_h),
        .n_physics = predictor_warm_up(self, self->late),
        .disagreement = trusted != NULL ? hsep_at(trusted, trusted->disagreement) + (trusted->n - self->n) : NULL,
        .doubt = trusted != NULL ? hsep_guard_doubt(&trusted->guard, trusted->scale.largest)
                                 : (hsep_doubt){HSEP_NO_DOUBT, 0.0}};
    if (self->divergence == HSEP_CONVERGES) {
        hsep_uncertainty_predict(hsep_predictor_uncertainty(self), &signals, first, last);
    }
}

/* Take in commands and x_pb of the window that begins as they came, eq. (2), behind those that are not measured yet. */
static void predictor_open(hsep_predictor *self)
{
    const uint64_t Np = self->Np;
    double *command = hsep_at(self, self->command), *past_x = hsep_at(self, self->past_x);
    for (uint64_t i = 0; i < Np; i++) {
        command[Np - 1 - i] = hsep_at(self, self->x_d)[i] - self->start;
        past_x[Np - 1 - i] = hsep_at(self, self->ahead_pb)[i];
    }
    /* of the whole window at once, though parts of it are published later */
    if (!hsep_within(past_x, self->n, HSEP_PREDICTION_MAX) && self->divergence == HSEP_CONVERGES) {
        self->divergence = HSEP_DIVERGES_X_PB;
    }
}

/* Samples of the window that are predicted in one go: with trust a part of them, as variances are dear; two at least,
 * because the spread of errors follows from differences. */
static uint64_t predictor_part(const hsep_predictor *self)
{
    const uint64_t part = (self->Np - 1) / predictor_parts + 1;
    return self->trusted ? (part > 2 ? part : 2) : self->Np;
}

/* Predict the next samples of the window; those that are not measured yet with the first of them. */
static void predictor_go_on(hsep_predictor *self)
{
    const uint64_t late = self->late, published = self->n_published, left = self->Np - published;
    const uint64_t part = predictor_part(self), last = published + (left < part ? left : part);
    const uint64_t first = published > 0 ? late + published : 0;
    hsep_trusted *trusted = hsep_predictor_trusted(self);
    double *e_h = hsep_at(self, self->e_h);
    if (trusted != NULL && first == 0) {
        hsep_trusted_forecast(trusted, hsep_at(self, self->command), hsep_at(self, self->past_x), e_h, late + last);
    } else if (trusted != NULL) {
        hsep_trusted_go_on(trusted, e_h, first, late + last);
    }
    hsep_predictor_publish(self, last);
    hsep_predictor_doubt(self, first, late + last);
}

HSEP_API int hsep_predictor_sample(hsep_predictor *self, double x_d_ahead, double x_meas)
{
    const uint64_t Np = self->Np;
    const double relative = x_d_ahead - self->start;
    double *ahead_pb = hsep_at(self, self->ahead_pb);
    hsep_physics_forced_response(hsep_predictor_physics(self), &relative, ahead_pb + self->k % Np, 1);
    if (!hsep_predictor_take_in(self, x_d_ahead, x_meas)) {
        if (self->n_published < Np) {
            predictor_go_on(self);
        }
        return 0;
    }
    (void)hsep_predictor_finish(self);
    if (self->k == self->preview) { /* the first fill was not predicted */
        memset(hsep_at(self, self->past_e), 0, (size_t)(self->n + self->features.p) * sizeof(double));
    }
    hsep_predictor_begin(self);
    predictor_open(self);
    self->n_physics = hsep_predictor_warm_up(self);
    predictor_go_on(self);
    return 1;
}

HSEP_API double hsep_predictor_std(const hsep_predictor *self, uint64_t i)
{
    const hsep_uncertainty *uncertainty = (const hsep_uncertainty *)hsep_at_const(self, self->uncertainty);
    return hsep_at_const(uncertainty, uncertainty->std)[self->Np - 1 - i];
}

static double predictor_rms(const hsep_predictor *self, double sum)
{
    return self->n_measured > 0 ? sqrt(sum / (double)self->n_measured) : 0.0;
}

HSEP_API void hsep_predictor_read(const hsep_predictor *self, hsep_predictor_outputs *outputs)
{
    const uint64_t i = self->k % self->Np;
    outputs->x_d = hsep_at_const(self, self->x_d)[i];
    outputs->x_pb = hsep_at_const(self, self->x_pb)[i];
    outputs->x_h = hsep_at_const(self, self->x_h)[i];
    outputs->x_h_std = hsep_predictor_std(self, i);
    outputs->rms_e = predictor_rms(self, self->sum_e);
    outputs->rms_pb = predictor_rms(self, self->sum_pb);
    outputs->rms_h = predictor_rms(self, self->sum_h);
    outputs->rms_hold = predictor_rms(self, self->sum_hold);
    outputs->batch = self->k / self->Np;
    outputs->n_rejected = self->trusted ? ((const hsep_trusted *)hsep_at_const(self, self->trusted))->n_rejected : 0;
    outputs->hybrid_active = i >= self->n_physics;
}

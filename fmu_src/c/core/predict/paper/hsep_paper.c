#include "hsep_paper.h"

#include "hsep_reference_features.h"

#include <stddef.h>
#include <string.h>

static const double paper_first_step = 1e-5; /* m, resolution of the sensor assumed before its first change */
static const double paper_still = 1e-8;      /* m, motion below which the drive counts as at rest */

HSEP_API hsep_regression *hsep_paper_regression(hsep_paper *self)
{
    return (hsep_regression *)hsep_at(self, self->regression);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double paper_lay_out(hsep_paper *self, const hsep_paper_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    const double preview = (double)parameters->preview;
    const int has_reference = parameters->v_friction > 0.0;
    double end = HSEP_WORDS(hsep_paper);
    hsep_features_lay_out(&self->features, settings->p, settings->q, has_reference ? HSEP_N_REFERENCE : 0);
    const double regression = hsep_regression_size(self->features.n);
    self->Np = settings->Np;
    self->n = settings->Np + settings->measurement_delay;
    self->preview = parameters->preview;
    self->sign_step = parameters->v_friction * settings->T_s;
    self->weights = hsep_take(&end, (double)self->features.n);
    self->signs = hsep_take(&end, has_reference ? preview + 2.0 * HSEP_REFERENCE_REACH : 0.0);
    self->drive = hsep_take(&end, has_reference ? preview : 0.0);
    self->regression = hsep_take_block(&end, regression);
    self->saved = parameters->unlearns ? hsep_take_block(&end, regression) : 0;
    return end * sizeof(double);
}

HSEP_API double hsep_paper_size(const hsep_paper_parameters *parameters)
{
    return paper_lay_out(&(hsep_paper){0}, parameters);
}

HSEP_API void hsep_paper_init(hsep_paper *self, const hsep_paper_parameters *parameters, double start)
{
    memset(self, 0, (size_t)hsep_paper_size(parameters));
    (void)paper_lay_out(self, parameters);
    self->x_d_last = start;
    hsep_sensor_init(&self->sensor);
    hsep_regression_init(hsep_paper_regression(self), self->features.n, parameters->settings->lambda);
}

HSEP_API int hsep_paper_valid(const void *block, const hsep_paper_parameters *parameters)
{
    hsep_paper got;
    memcpy(&got, block, sizeof got);
    (void)paper_lay_out(&got, parameters); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 && got.missing <= 1 && (!got.missing || got.saved) &&
           hsep_regression_valid(hsep_at_bytes(block, got.regression), got.features.n) &&
           (!got.saved || hsep_regression_valid(hsep_at_bytes(block, got.saved), got.features.n));
}

HSEP_API hsep_recursion hsep_paper_recursion(const hsep_paper *self, int with_bias)
{
    const hsep_features *f = &self->features;
    const double *w = hsep_at_const(self, self->weights);
    return (hsep_recursion){
        .w_x = w + f->x, .w_e = w + f->e, .p = f->p, .q = f->q, .bias = with_bias ? w[HSEP_BIAS] : 0.0};
}

HSEP_API const double *hsep_paper_drive(const hsep_paper *self, uint64_t n)
{
    const int has_reference = self->features.n > self->features.reference;
    return has_reference ? hsep_at_const(self, self->drive) + (self->preview - n) : NULL;
}

/* Fold the row of sample i of its window into the regression; eqs. (5) and (6). */
static void paper_learn(hsep_paper *self, const hsep_residual_sample *sample)
{
    const hsep_features *f = &self->features;
    double *row = hsep_regression_row(hsep_paper_regression(self)); /* phi(k), its target e_pb(k) behind it */
    row[HSEP_BIAS] = 1.0;
    memcpy(row + f->x, sample->x, (size_t)(f->q + 1) * sizeof(double));
    memcpy(row + f->e, sample->e + 1, (size_t)f->p * sizeof(double));
    if (f->n > f->reference) {
        hsep_reference_features_at(hsep_at(self, self->signs), sample->i, row + f->reference);
    }
    row[f->n] = sample->e[0];
    hsep_regression_fold(hsep_paper_regression(self));
}

HSEP_API void hsep_paper_take_in(hsep_paper *self, const hsep_residual_sample *sample, int learning)
{
    /* A measurement held while the drive moves is missing. */
    if (self->saved && hsep_sensor_misses(&self->sensor, sample->x_meas, sample->x_pb, paper_still, paper_first_step)) {
        self->missing = 1;
    }
    if (learning && !self->missing) {
        paper_learn(self, sample);
    }
}

/* Unlearn the window: restore the regression, and replace the residuals by their predictions. */
static void paper_unlearn(hsep_paper *self, const hsep_residual_window *window)
{
    memcpy(
        hsep_at(self, self->regression), hsep_at(self, self->saved),
        (size_t)(self->saved - self->regression) * sizeof(double));
    for (uint64_t i = 0, j = self->Np; j-- > 0; i++) {
        window->e[j] = i < window->n_physics ? 0.0 : window->e_h[j];
    }
}

HSEP_API int hsep_paper_finish(hsep_paper *self, const hsep_residual_window *window)
{
    if (self->missing) {
        paper_unlearn(self, window);
    }
    if (self->features.n > self->features.reference) {
        hsep_reference_features_advance(hsep_at(self, self->signs), self->Np);
    }
    self->x_d_last = window->x_d[self->Np - 1];
    return !self->missing;
}

/* Features of the reference over the window that begins, and their part of the residuals. */
static void paper_reference(hsep_paper *self, const double x_d[])
{
    const double *w = hsep_at(self, self->weights) + self->features.reference;
    double *signs = hsep_at(self, self->signs), *drive = hsep_at(self, self->drive);
    double features[HSEP_N_REFERENCE];
    hsep_reference_features_signs(signs, x_d, self->preview, self->x_d_last, self->sign_step);
    for (uint64_t k = 0; k < self->preview; k++) {
        double sum = 0.0;
        hsep_reference_features_at(signs, k, features);
        for (int i = 0; i < HSEP_N_REFERENCE; i++) {
            sum += features[i] * w[i];
        }
        drive[self->preview - 1 - k] = sum;
    }
}

HSEP_API int hsep_paper_begin(hsep_paper *self, const hsep_residual_window *window)
{
    const int measured = !self->missing;
    hsep_regression_solve(hsep_paper_regression(self), hsep_at(self, self->weights));
    if (self->features.n > self->features.reference) {
        paper_reference(self, window->x_d);
    }
    self->missing = 0;
    if (self->saved) {
        memcpy(
            hsep_at(self, self->saved), hsep_at(self, self->regression),
            (size_t)(self->saved - self->regression) * sizeof(double));
    }
    return measured;
}

HSEP_API void hsep_paper_predict(
    const hsep_paper *self, const hsep_residual_window *window, uint64_t first, uint64_t last)
{
    const hsep_recursion recursion = hsep_paper_recursion(self, 1);
    hsep_recursion_run(
        &recursion, window->x_pb, hsep_paper_drive(self, self->Np), window->e_h, self->n, first, last); /* Eq. (4) */
}

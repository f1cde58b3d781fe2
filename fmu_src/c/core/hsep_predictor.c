#include "hsep_predictor.h"

#include "hsep_recursion.h"
#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

static hsep_physics *predictor_physics(hsep_predictor *self) { return (hsep_physics *)hsep_at(self, self->physics); }

HSEP_API hsep_regression *hsep_predictor_regression(hsep_predictor *self)
{
    return (hsep_regression *)hsep_at(self, self->regression);
}

HSEP_API const double *hsep_predictor_array(const hsep_predictor *self, uint64_t offset)
{
    return hsep_at_const(self, offset);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double predictor_lay_out(hsep_predictor *self, const hsep_predictor_parameters *parameters)
{
    const double Np = (double)parameters->Np, p = (double)parameters->p, q = (double)parameters->q;
    double end = HSEP_WORDS(hsep_predictor);
    self->Np = parameters->Np;
    self->p = parameters->p;
    self->q = parameters->q;
    self->n_init = parameters->n_init;
    self->ahead = hsep_take(&end, Np);
    self->ahead_pb = hsep_take(&end, Np);
    self->x_d = hsep_take(&end, Np);
    self->x_pb = hsep_take(&end, Np);
    self->x_h = hsep_take(&end, Np);
    self->past_x = hsep_take(&end, Np + q);
    self->past_e = hsep_take(&end, Np + p);
    self->weights = hsep_take(&end, 2.0 + q + p);
    self->physics = hsep_take_block(&end, hsep_physics_size(parameters->n_modes, parameters->dead_time));
    self->regression = hsep_take_block(&end, hsep_regression_size(2 + parameters->q + parameters->p));
    return end * sizeof(double);
}

HSEP_API double hsep_predictor_size(const hsep_predictor_parameters *parameters)
{
    hsep_predictor layout;
    return predictor_lay_out(&layout, parameters);
}

HSEP_API void hsep_predictor_init(hsep_predictor *self, const hsep_predictor_parameters *parameters, double start)
{
    memset(self, 0, (size_t)hsep_predictor_size(parameters));
    (void)predictor_lay_out(self, parameters);
    self->start = start;
    self->n_warm_up = self->Np; /* the first fill is not predicted */
    for (uint64_t i = 0; i < self->Np; i++) {
        hsep_at(self, self->x_d)[i] = start;
        hsep_at(self, self->x_pb)[i] = start;
        hsep_at(self, self->x_h)[i] = start;
    }
    hsep_physics_init(
        predictor_physics(self), parameters->modes, parameters->n_modes, parameters->dead_time, parameters->T_s,
        parameters->hold);
    hsep_regression_init(hsep_predictor_regression(self), 2 + self->q + self->p, parameters->lambda);
}

HSEP_API int hsep_predictor_valid(const void *block, const hsep_predictor_parameters *parameters)
{
    hsep_predictor expected, got;
    memcpy(&got, block, sizeof got);
    /* What may differ from a fresh block of these parameters is taken over, the rest must be equal. */
    expected = got;
    (void)predictor_lay_out(&expected, parameters);
    return memcmp(&expected, &got, sizeof got) == 0 && got.n_warm_up <= got.Np && got.divergence <= HSEP_DIVERGES_X_H &&
           (got.divergence || hsep_within(hsep_at_bytes(block, got.ahead), 5 * got.Np, HSEP_PREDICTION_MAX)) &&
           got.sum_pb >= 0.0 && isfinite(got.sum_pb) && got.sum_h >= 0.0 && isfinite(got.sum_h) &&
           hsep_physics_valid(hsep_at_bytes(block, got.physics), parameters->n_modes, parameters->dead_time) &&
           hsep_regression_valid(hsep_at_bytes(block, got.regression), 2 + parameters->q + parameters->p);
}

/* Solve the weights from all that was learned and predict the window that begins. */
static void predictor_next_window(hsep_predictor *self)
{
    const uint64_t Np = self->Np, p = self->p, q = self->q;
    double *past_x = hsep_at(self, self->past_x), *past_e = hsep_at(self, self->past_e);
    double *w = hsep_at(self, self->weights);
    const double *ahead = hsep_at(self, self->ahead), *ahead_pb = hsep_at(self, self->ahead_pb);
    double *x_d = hsep_at(self, self->x_d), *x_pb = hsep_at(self, self->x_pb);
    double *x_h = hsep_at(self, self->x_h);

    memcpy(past_x + Np, past_x, (size_t)q * sizeof(double)); /* q < Np, p <= Np: they do not overlap */
    memcpy(past_e + Np, past_e, (size_t)p * sizeof(double));
    hsep_regression_solve(hsep_predictor_regression(self), w); /* Eq. (6) */
    for (uint64_t i = 0; i < Np; i++) {
        past_x[Np - 1 - i] = ahead_pb[i]; /* Eq. (2), answered command by command as they came */
    }
    const hsep_recursion recursion = {.w_x = w + 1, .w_e = w + 2 + q, .p = p, .q = q, .bias = w[0]};
    hsep_recursion_run(&recursion, past_x, NULL, past_e, Np, 0, Np); /* Eq. (4) */

    /* The fill is over at k = Np; the warm-up counts from there. */
    const double warm_up = self->n_init - (double)(self->k - Np);
    self->n_warm_up = warm_up >= (double)Np ? Np : warm_up > 0.0 ? (uint64_t)warm_up : 0;
    for (uint64_t i = 0; i < Np; i++) {
        x_d[i] = ahead[i];
        x_pb[i] = ahead_pb[i] + self->start;
        x_h[i] = i < self->n_warm_up ? x_pb[i] : x_pb[i] + past_e[Np - 1 - i]; /* Eq. (4) */
    }
    if (!hsep_within(x_pb, Np, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_PB;
    } else if (!hsep_within(x_h, Np, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_H;
    }
}

/* Fold the row of a sample, at place i of its window, into the regression; eqs. (5) and (6). */
static void predictor_learn(hsep_predictor *self, uint64_t i, double x_meas)
{
    const uint64_t p = self->p, q = self->q, j = self->Np - 1 - i;
    const double *x = hsep_at(self, self->past_x) + j;
    double *e = hsep_at(self, self->past_e) + j;
    double *row = hsep_regression_row(hsep_predictor_regression(self));
    e[0] = x_meas - self->start - x[0]; /* e_pb = x - x_pb */
    /* phi(k) = [1, x_pb(k) ... x_pb(k-q), e_pb(k-1) ... e_pb(k-p)], its target e_pb(k) beside it */
    row[0] = 1.0;
    memcpy(row + 1, x, (size_t)(q + 1) * sizeof(double));
    memcpy(row + 2 + q, e + 1, (size_t)p * sizeof(double));
    row[2 + q + p] = e[0];
    hsep_regression_fold(hsep_predictor_regression(self));
}

HSEP_API int hsep_predictor_sample(hsep_predictor *self, double x_d_ahead, double x_meas)
{
    const uint64_t i = self->k % self->Np;
    const double relative = x_d_ahead - self->start;
    hsep_at(self, self->ahead)[i] = x_d_ahead;
    hsep_physics_respond(predictor_physics(self), &relative, hsep_at(self, self->ahead_pb) + i, 1);
    if (self->k >= self->Np) {
        predictor_learn(self, i, x_meas);
        if ((double)(self->k - self->Np) >= self->n_init) {
            const double e_pb = x_meas - hsep_at(self, self->x_pb)[i];
            const double e_h = x_meas - hsep_at(self, self->x_h)[i];
            self->n_measured++;
            self->sum_pb += e_pb * e_pb;
            self->sum_h += e_h * e_h;
        }
    }
    self->k++;
    if (self->k % self->Np != 0) {
        return 0;
    }
    predictor_next_window(self);
    return 1;
}

HSEP_API void hsep_predictor_read(const hsep_predictor *self, hsep_predictor_outputs *outputs)
{
    const uint64_t i = self->k % self->Np;
    outputs->x_d = hsep_predictor_array(self, self->x_d)[i];
    outputs->x_pb = hsep_predictor_array(self, self->x_pb)[i];
    outputs->x_h = hsep_predictor_array(self, self->x_h)[i];
    outputs->rms_pb = self->n_measured > 0 ? sqrt(self->sum_pb / (double)self->n_measured) : 0.0;
    outputs->rms_h = self->n_measured > 0 ? sqrt(self->sum_h / (double)self->n_measured) : 0.0;
    outputs->batch = self->k / self->Np;
    outputs->hybrid_active = i >= self->n_warm_up;
}

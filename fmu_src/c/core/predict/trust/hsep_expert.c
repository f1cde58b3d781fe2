#include "hsep_expert.h"

#include "hsep_penalised.h"
#include "hsep_predict_constants.h"
#include "hsep_trust_constants.h"
#include "hsep_vector.h"
#include "hsep_wide.h"

#include <math.h>
#include <string.h>

HSEP_API void hsep_residual_scale_follow(
    hsep_residual_scale *self, const double residuals[], const double accepted[], uint64_t n, double count)
{
    double sum = 0.0;
    for (uint64_t j = 0; j < n; j++) {
        const double residual = accepted[j] * residuals[j];
        sum += residual * residual;
        self->largest = fmax(self->largest, fabs(residual));
    }
    self->largest_square = fmax(self->largest_square, sum / count);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double expert_lay_out(hsep_expert *self, const hsep_expert_shape *shape)
{
    const double window = (double)shape->n, lags = (double)shape->p, n = (double)shape->n_static + lags;
    double end = HSEP_WORDS(hsep_expert);
    self->Np = shape->Np;
    self->n = shape->n;
    self->n_static = shape->n_static;
    self->p = shape->p;
    self->penalties = hsep_take(&end, n);
    self->weights = hsep_take(&end, n);
    self->run = hsep_take(&end, window + lags);
    self->unshrunk = hsep_take(&end, window + lags);
    self->e_h = hsep_take(&end, window);
    self->kept = hsep_take(&end, window);
    self->response = hsep_take(&end, window + lags);
    self->squares = hsep_take(&end, window);
    self->variances = hsep_take(&end, window);
    self->solved = hsep_take_block(&end, hsep_regression_size(shape->n_static + shape->p));
    return end * sizeof(double);
}

static hsep_regression *expert_solved(hsep_expert *self) { return (hsep_regression *)hsep_at(self, self->solved); }

HSEP_API double hsep_expert_size(const hsep_expert_shape *shape) { return expert_lay_out(&(hsep_expert){0}, shape); }

HSEP_API void hsep_expert_init(hsep_expert *self, const hsep_expert_shape *shape)
{
    memset(self, 0, (size_t)hsep_expert_size(shape));
    (void)expert_lay_out(self, shape);
    self->correlation = 1.0;
    hsep_regression_init(expert_solved(self), shape->n_static + shape->p, 1.0);
}

HSEP_API int hsep_expert_valid(const void *block, const hsep_expert_shape *shape)
{
    hsep_expert got;
    memcpy(&got, block, sizeof got);
    (void)expert_lay_out(&got, shape); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 &&
           hsep_regression_valid(hsep_at_bytes(block, got.solved), shape->n_static + shape->p);
}

HSEP_API double hsep_expert_shrink(const hsep_expert *self, uint64_t j)
{
    const double unshrunk = hsep_at_const(self, self->unshrunk)[j];
    return unshrunk == 0.0 ? hsep_at_const(self, self->kept)[j] : hsep_at_const(self, self->e_h)[j] / unshrunk;
}

HSEP_API void hsep_expert_solve(hsep_expert *self, const hsep_expert_evidence *evidence)
{
    const double noise = self->noise_variance > 0.0 ? self->noise_variance : evidence->first;
    double *penalties = hsep_at(self, self->penalties);
    self->variance = fmax(noise, evidence->least) * self->correlation;
    memcpy(penalties, evidence->scales, (size_t)self->n_static * sizeof(double));
    for (uint64_t i = 0; i < self->p; i++) {
        penalties[self->n_static + i] = sqrt(pow(HSEP_TRUST_LAST_LAG, (double)i / (double)self->p));
    }
    for (uint64_t i = 0; i < self->n_static + self->p; i++) {
        penalties[i] = self->variance / (penalties[i] * penalties[i]);
    }
    self->rows_variance =
        hsep_penalised_solve(
            evidence->regression, penalties, expert_solved(self), hsep_at(self, self->weights), evidence->work) /
        evidence->n_rows;
}

static double expert_bounded(double value, double bound) { return fmax(-bound, fmin(value, bound)); }

/* e(k) := e(k) + sum_i w_i e(k - i) over a window; eq. (4). */
static void expert_run(const hsep_expert *self, double e[])
{
    const double *lag_weights = hsep_at_const(self, self->weights) + self->n_static;
    for (uint64_t j = self->n; self->p > 0 && j-- > 0;) {
        e[j] = hsep_recur(e[j], lag_weights, e + j + 1, self->p);
    }
}

/* Free run from the last residuals, and the same within bounds. */
static void expert_free_run(hsep_expert *self, const double rows[], const double past[])
{
    const uint64_t n = self->n, n_static = self->n_static;
    const double *weights = hsep_at(self, self->weights);
    double *run = hsep_at(self, self->run), *unshrunk = hsep_at(self, self->unshrunk);
    for (uint64_t j = n; j-- > 0; rows += n_static) {
        run[j] = hsep_dot(weights, rows, n_static);
    }
    memcpy(run + n, past, (size_t)self->p * sizeof(double));
    memcpy(unshrunk + n, past, (size_t)self->p * sizeof(double));
    expert_run(self, run);
    for (uint64_t j = 0; j < n; j++) {
        unshrunk[j] = isfinite(run[j]) ? expert_bounded(run[j], HSEP_EXPERT_LAG_BOUND * self->bound) : 0.0;
    }
}

/* Squares of the recursion's impulse response. */
static void expert_respond(hsep_expert *self)
{
    const uint64_t n = self->n;
    double *response = hsep_at(self, self->response), *squares = hsep_at(self, self->squares);
    memset(response, 0, (size_t)(n + self->p) * sizeof(double));
    response[n - 1] = 1.0;
    expert_run(self, response);
    for (uint64_t i = 0; i < n; i++) {
        const double at = response[n - 1 - i];
        const double within = isnan(at) ? HSEP_EXPERT_DIVERGED : expert_bounded(at, HSEP_EXPERT_DIVERGED);
        squares[i] = within * within;
    }
}

/* Largest variance that counts, m2. */
static double expert_most(const hsep_expert *self) { return HSEP_EXPERT_DIVERGED * self->bound * self->bound; }

/* Variance of sample k of a prediction: that of the rows, carried through the impulse response; wide: hsep_is_wide. */
static double expert_variance(hsep_expert *self, const double row_of_k[], uint64_t k, int wide)
{
    const uint64_t j = self->n - 1 - k, p = self->p;
    const double *squares = hsep_at(self, self->squares), most = expert_most(self);
    double *variances = hsep_at(self, self->variances), *row = hsep_regression_row(expert_solved(self));
    memcpy(row, row_of_k, (size_t)self->n_static * sizeof(double));
    memcpy(row + self->n_static, hsep_at(self, self->unshrunk) + j + 1, (size_t)p * sizeof(double));
    variances[j] = self->variance * hsep_penalised_leverage(expert_solved(self), wide);
    const double carried = p > 0 ? hsep_dot(squares, variances + j, k + 1) : variances[j];
    return isfinite(hsep_at(self, self->run)[j]) ? fmin(carried, most) : most;
}

/* What a variance, m2, leaves of a prediction. */
static double expert_kept(const hsep_expert *self, double variance)
{
    return self->largest_square / (self->largest_square + variance);
}

/* Shrink the free run at places begin ... end - 1. */
static void expert_shrink(hsep_expert *self, uint64_t begin, uint64_t end)
{
    const double *unshrunk = hsep_at(self, self->unshrunk), *kept = hsep_at(self, self->kept);
    double *e_h = hsep_at(self, self->e_h);
    for (uint64_t j = begin; j < end; j++) {
        e_h[j] = expert_bounded(unshrunk[j], self->bound) * kept[j];
    }
}

HSEP_API void hsep_expert_vary(hsep_expert *self, const double rows[], uint64_t first, uint64_t last)
{
    const double n = (double)(self->n_static + self->p);
    const int wide = hsep_is_wide((double)(last - first) * n * n / 2.0);
    double *kept = hsep_at(self, self->kept);
    if (first == 0 && self->p > 0) {
        expert_respond(self);
    }
    for (uint64_t k = first; k < last; k++) {
        kept[self->n - 1 - k] = expert_kept(self, expert_variance(self, rows + k * self->n_static, k, wide));
    }
    expert_shrink(self, self->n - last, self->n - first);
}

HSEP_API void hsep_expert_predict(
    hsep_expert *self, const double rows[], const double past[], double largest_square, double bound, uint64_t varied)
{
    double *kept = hsep_at(self, self->kept);
    self->largest_square = largest_square;
    self->bound = bound;
    expert_free_run(self, rows, past);
    if (varied > 0) {
        hsep_expert_vary(self, rows, 0, varied);
        for (uint64_t j = 0; j < self->n - varied; j++) {
            kept[j] = expert_kept(self, expert_most(self));
        }
    }
    expert_shrink(self, 0, self->n);
}

HSEP_API void hsep_expert_judge(hsep_expert *self, const double measured[], const double accepted[], double given)
{
    const double *unshrunk = hsep_at(self, self->unshrunk) + (self->n - self->Np); /* of the window */
    double sum = 0.0, n = 0.0;
    for (uint64_t j = 0; j < self->Np; j++) {
        sum += accepted[j] * (measured[j] - unshrunk[j]);
        n += accepted[j];
    }
    self->noise_variance = given > 0.0 ? given : self->rows_variance;
    if (self->noise_variance > 0.0) {
        const double seen = fmin(sum * sum / n / self->noise_variance, HSEP_EXPERT_DIVERGED);
        self->correlation += HSEP_TRUST_CORRELATION_RATE * (seen - self->correlation);
        self->correlation = fmin(fmax(self->correlation, 1.0), HSEP_TRUST_CORRELATION_MAX);
    }
}

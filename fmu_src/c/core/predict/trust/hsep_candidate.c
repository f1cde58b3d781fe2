#include "hsep_candidate.h"

#include "hsep_penalised.h"
#include "hsep_vector.h"

#include <math.h>
#include <string.h>

/* Prior variance of the weight of the last lag relative to that of the first. */
static const double candidate_last_lag = 0.005;

/* Factor on the predicted variance when a prediction is shrunk by it: its distribution has long tails. */
static const double candidate_caution = 2.0;

/* Largest lag within a window and largest prediction, relative to the largest residual. */
static const double candidate_lag_max = 10.0, candidate_prediction_max = 1.2;

/* Bound on the impulse response, and on the variance relative to the square of the largest residual. */
static const double candidate_diverged = 1e6;

/* Correlation before a window is measured, in windows: at any sampling rate the same time; and its bound, in rows. */
static const double candidate_first_correlation = 0.1, candidate_correlation_max = 1e4;
static const double candidate_correlation_rate = 0.1;

/* Set what follows from the parameters; return the bytes of the block. */
static double candidate_lay_out(hsep_candidate *self, const hsep_candidate_shape *shape)
{
    const double window = (double)shape->n, lags = (double)shape->p, n = (double)shape->n_static + lags;
    double end = HSEP_WORDS(hsep_candidate);
    self->Np = shape->Np;
    self->n = shape->n;
    self->n_static = shape->n_static;
    self->p = shape->p;
    self->correlation_max = shape->correlation_max;
    self->priors = hsep_take(&end, n);
    self->weights = hsep_take(&end, n);
    self->run = hsep_take(&end, window + lags);
    self->unshrunk = hsep_take(&end, window + lags);
    self->e_h = hsep_take(&end, window);
    self->response = hsep_take(&end, window + lags);
    self->squares = hsep_take(&end, window);
    self->leverage = hsep_take(&end, window);
    self->spread = hsep_take(&end, window);
    self->mean_square = hsep_take(&end, window);
    self->solved = hsep_take_block(&end, hsep_regression_size(shape->n_static + shape->p));
    return end * sizeof(double);
}

static hsep_regression *candidate_solved(hsep_candidate *self)
{
    return (hsep_regression *)hsep_at(self, self->solved);
}

HSEP_API double hsep_candidate_size(const hsep_candidate_shape *shape)
{
    return candidate_lay_out(&(hsep_candidate){0}, shape);
}

HSEP_API void hsep_candidate_init(hsep_candidate *self, const hsep_candidate_shape *shape)
{
    memset(self, 0, (size_t)hsep_candidate_size(shape));
    (void)candidate_lay_out(self, shape);
    self->correlation = fmax(candidate_first_correlation * (double)self->Np, 1.0);
    hsep_regression_init(candidate_solved(self), shape->n_static + shape->p, 1.0);
}

HSEP_API int hsep_candidate_valid(const void *block, const hsep_candidate_shape *shape)
{
    hsep_candidate got;
    memcpy(&got, block, sizeof got);
    (void)candidate_lay_out(&got, shape); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 &&
           hsep_regression_valid(hsep_at_bytes(block, got.solved), shape->n_static + shape->p);
}

/* The window's part of a signal of all predicted samples. */
static const double *candidate_window(const hsep_candidate *self, uint64_t signal)
{
    return hsep_at_const(self, signal) + (self->n - self->Np);
}

HSEP_API const double *hsep_candidate_prediction(const hsep_candidate *self)
{
    return candidate_window(self, self->e_h);
}

/* What the variance leaves of sample j of a prediction. */
static double candidate_kept(const hsep_candidate *self, uint64_t j)
{
    const double mean_square = hsep_at_const(self, self->mean_square)[j];
    return mean_square / (mean_square + candidate_caution * hsep_at_const(self, self->spread)[j]);
}

HSEP_API double hsep_candidate_shrink(const hsep_candidate *self, uint64_t j)
{
    const double unshrunk = hsep_at_const(self, self->unshrunk)[j];
    return unshrunk == 0.0 ? candidate_kept(self, j) : hsep_at_const(self, self->e_h)[j] / unshrunk;
}

HSEP_API void hsep_candidate_solve(
    hsep_candidate *self, const hsep_regression *regression, const double static_scales[], double least_variance)
{
    double *penalties = hsep_at(self, self->priors);
    self->variance = fmax(self->noise_variance, least_variance) * fmin(self->correlation, self->correlation_max);
    memcpy(penalties, static_scales, (size_t)self->n_static * sizeof(double));
    for (uint64_t i = 0; i < self->p; i++) {
        penalties[self->n_static + i] = sqrt(pow(candidate_last_lag, (double)i / (double)self->p));
    }
    for (uint64_t i = 0; i < self->n_static + self->p; i++) {
        penalties[i] = self->variance / (penalties[i] * penalties[i]);
    }
    self->residual_sum =
        hsep_penalised_solve(regression, penalties, candidate_solved(self), hsep_at(self, self->weights));
}

static double candidate_bounded(double value, double bound) { return fmax(-bound, fmin(value, bound)); }

/* e(k) := e(k) + sum_i w_i e(k - i) over a window; eq. (4). */
static void candidate_run(const hsep_candidate *self, double e[])
{
    const double *lag_weights = hsep_at_const(self, self->weights) + self->n_static;
    for (uint64_t j = self->n; self->p > 0 && j-- > 0;) {
        e[j] = hsep_recur(e[j], lag_weights, e + j + 1, self->p);
    }
}

/* Free run from the last residuals, and the same within bounds. */
static void candidate_free_run(hsep_candidate *self, const double rows[], const double past[], double bound)
{
    const uint64_t n = self->n, n_static = self->n_static;
    const double *weights = hsep_at(self, self->weights);
    double *run = hsep_at(self, self->run), *unshrunk = hsep_at(self, self->unshrunk);
    for (uint64_t j = n; j-- > 0; rows += n_static) {
        run[j] = hsep_dot(weights, rows, n_static);
    }
    memcpy(run + n, past, (size_t)self->p * sizeof(double));
    memcpy(unshrunk + n, past, (size_t)self->p * sizeof(double));
    candidate_run(self, run);
    for (uint64_t j = 0; j < n; j++) {
        unshrunk[j] = isfinite(run[j]) ? candidate_bounded(run[j], bound) : 0.0;
    }
}

/* Squares of the recursion's impulse response. */
static void candidate_respond(hsep_candidate *self)
{
    const uint64_t n = self->n;
    double *response = hsep_at(self, self->response), *squares = hsep_at(self, self->squares);
    memset(response, 0, (size_t)(n + self->p) * sizeof(double));
    response[n - 1] = 1.0;
    candidate_run(self, response);
    for (uint64_t i = 0; i < n; i++) {
        const double at = response[n - 1 - i];
        const double within = isnan(at) ? candidate_diverged : candidate_bounded(at, candidate_diverged);
        squares[i] = within * within;
    }
}

/* Variance of samples first ... last - 1: that of the rows, carried through the impulse response; at most most. */
static void candidate_spread(hsep_candidate *self, const double rows[], double most, uint64_t first, uint64_t last)
{
    const uint64_t n = self->n, n_static = self->n_static, p = self->p;
    const double *run = hsep_at(self, self->run), *unshrunk = hsep_at(self, self->unshrunk);
    const double *squares = hsep_at(self, self->squares);
    double *spread = hsep_at(self, self->spread), *leverage = hsep_at(self, self->leverage);
    double *row = hsep_regression_row(candidate_solved(self));
    for (uint64_t k = first; k < last; k++) {
        const uint64_t j = n - 1 - k;
        memcpy(row, rows + k * n_static, (size_t)n_static * sizeof(double));
        memcpy(row + n_static, unshrunk + j + 1, (size_t)p * sizeof(double));
        leverage[j] = self->variance * hsep_penalised_leverage(candidate_solved(self));
        spread[j] = p > 0 ? fmin(hsep_dot(squares, leverage + j, k + 1), most) : leverage[j];
        spread[j] = isfinite(run[j]) ? spread[j] : most;
    }
}

/* Mean square that the residual may have: the recent one, or where the prediction so far is beyond its own variance
 * that, up to the largest one of a window, and less where it is larger than any residual yet. */
static void candidate_mean_square(hsep_candidate *self, const hsep_residual_scale *scale)
{
    const double *unshrunk = hsep_at(self, self->unshrunk), *spread = hsep_at(self, self->spread);
    double *mean_square = hsep_at(self, self->mean_square), sum = 0.0, largest = scale->largest;
    for (uint64_t j = self->n; j-- > 0;) {
        sum += unshrunk[j] * unshrunk[j] - spread[j];
        largest = fmax(largest, fabs(unshrunk[j]));
        const double seen = scale->largest / largest, beyond = fmin(sum / (double)(self->n - j), scale->largest_square);
        mean_square[j] = fmax(beyond * (seen * seen), scale->recent);
    }
}

HSEP_API void hsep_candidate_vary(
    hsep_candidate *self, const double rows[], const hsep_residual_scale *scale, uint64_t first, uint64_t last)
{
    const double most = candidate_diverged * scale->largest * scale->largest;
    double *spread = hsep_at(self, self->spread);
    if (first == 0 && self->p > 0) {
        candidate_respond(self);
    }
    candidate_spread(self, rows, most, first, last);
    for (uint64_t j = 0; j < self->n - last; j++) {
        spread[j] = most;
    }
    candidate_mean_square(self, scale);
}

/* Shrink the free run by its variance, samples first ... last - 1. */
static void candidate_shrink(hsep_candidate *self, double largest, uint64_t first, uint64_t last)
{
    const double *unshrunk = hsep_at(self, self->unshrunk);
    double *e_h = hsep_at(self, self->e_h);
    for (uint64_t j = self->n - last; j < self->n - first; j++) {
        e_h[j] = candidate_bounded(unshrunk[j] * candidate_kept(self, j), candidate_prediction_max * largest);
    }
}

HSEP_API void hsep_candidate_predict(
    hsep_candidate *self, const double rows[], const double past[], const hsep_residual_scale *scale, uint64_t varied)
{
    candidate_free_run(self, rows, past, candidate_lag_max * scale->largest);
    if (varied > 0) {
        hsep_candidate_vary(self, rows, scale, 0, varied);
    }
    candidate_shrink(self, scale->largest, 0, self->n);
}

HSEP_API void hsep_candidate_go_on(
    hsep_candidate *self, const double rows[], const hsep_residual_scale *scale, uint64_t first, uint64_t last)
{
    hsep_candidate_vary(self, rows, scale, first, last);
    candidate_shrink(self, scale->largest, first, last);
}

HSEP_API void hsep_candidate_judge(hsep_candidate *self, const double measured[], const double accepted[])
{
    const double *unshrunk = candidate_window(self, self->unshrunk);
    double sum = 0.0, n = 0.0;
    for (uint64_t j = 0; j < self->Np; j++) {
        sum += accepted[j] * (measured[j] - unshrunk[j]);
        n += accepted[j];
    }
    const double seen = self->noise_variance > 0.0 ? sum * sum / n / self->noise_variance : candidate_correlation_max;
    self->correlation += candidate_correlation_rate * (fmin(seen, candidate_correlation_max) - self->correlation);
    self->correlation = fmax(self->correlation, 1.0);
}

HSEP_API double hsep_candidate_surprise(const hsep_candidate *self, const double measured[], const double accepted[])
{
    const double *unshrunk = candidate_window(self, self->unshrunk), *spread = candidate_window(self, self->spread);
    double squares = 0.0, expected = 0.0, n = 0.0;
    for (uint64_t j = 0; j < self->Np; j++) {
        const double error = measured[j] - unshrunk[j];
        squares += accepted[j] * error * error;
        expected += spread[j];
        n += accepted[j];
    }
    return squares / n / (self->variance + expected / (double)self->Np);
}

#include "hsep_expert.h"

#include "hsep_cholesky.h"
#include "hsep_predict_constants.h"
#include "hsep_range.h"
#include "hsep_trust_constants.h"
#include "hsep_vector.h"

#include <math.h>
#include <string.h>

HSEP_API void hsep_residual_scale_follow(
    hsep_residual_scale *self, const double residuals[], const double accepted[], uint64_t n, double count)
{
    double sum = 0.0;
    for (uint64_t j = 0; j < n; j++) {
        const double residual = accepted[j] * residuals[j];
        sum += residual * residual;
        self->largest = fabs(residual) > self->largest ? fabs(residual) : self->largest;
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
    self->lag_scales = hsep_take(&end, lags);
    self->penalties = hsep_take(&end, n);
    self->weights = hsep_take(&end, n);
    self->run = hsep_take(&end, window + lags);
    self->unshrunk = hsep_take(&end, window + lags);
    self->e_h = hsep_take(&end, window);
    self->kept = hsep_take(&end, window);
    self->response = hsep_take(&end, window + lags);
    self->squares = hsep_take(&end, window);
    self->variances = hsep_take(&end, window);
    self->factor = hsep_take(&end, hsep_triangle(shape->n_static + shape->p + 1));
    self->side_by_side = hsep_take(&end, HSEP_GRAM_ABREAST * (n + 1.0));
    return end * sizeof(double);
}

HSEP_API double hsep_expert_size(const hsep_expert_shape *shape) { return expert_lay_out(&(hsep_expert){0}, shape); }

HSEP_API void hsep_expert_init(hsep_expert *self, const hsep_expert_shape *shape)
{
    memset(self, 0, (size_t)hsep_expert_size(shape));
    (void)expert_lay_out(self, shape);
    self->correlation = 1.0;
    for (uint64_t i = 0; i < self->p; i++) {
        hsep_at(self, self->lag_scales)[i] = sqrt(pow(HSEP_TRUST_LAST_LAG, (double)i / (double)self->p));
    }
}

HSEP_API int hsep_expert_valid(const void *block, const hsep_expert_shape *shape)
{
    hsep_expert got;
    memcpy(&got, block, sizeof got);
    (void)expert_lay_out(&got, shape); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0;
}

HSEP_API double hsep_expert_shrink(const hsep_expert *self, uint64_t j)
{
    const double unshrunk = hsep_at_const(self, self->unshrunk)[j];
    return unshrunk == 0.0 ? hsep_at_const(self, self->kept)[j] : hsep_at_const(self, self->e_h)[j] / unshrunk;
}

HSEP_API void hsep_expert_solve(hsep_expert *self, const hsep_expert_evidence *evidence)
{
    const double noise = self->noise_variance > 0.0 ? self->noise_variance : evidence->first;
    const double of_other = evidence->other != NULL ? evidence->weight * hsep_gram_square(evidence->other) : 0.0;
    const double resolved = HSEP_EXPERT_RESOLUTION * (hsep_gram_square(evidence->gram) + of_other);
    const uint64_t n = self->n_static + self->p;
    double *penalties = hsep_at(self, self->penalties);
    self->variance = fmax(fmax(noise, evidence->least), resolved) * self->correlation;
    memcpy(penalties, evidence->scales, (size_t)self->n_static * sizeof(double));
    memcpy(penalties + self->n_static, hsep_at(self, self->lag_scales), (size_t)self->p * sizeof(double));
    for (uint64_t i = 0; i < n; i++) {
        penalties[i] = self->variance / (penalties[i] * penalties[i]);
    }
    const double sum = hsep_gram_solve(
        evidence->gram, evidence->other, evidence->weight, penalties, n, hsep_at(self, self->factor),
        hsep_at(self, self->side_by_side), hsep_at(self, self->weights));
    self->rows_variance = fmax(sum, resolved) / evidence->n_rows;
}

/* Free run of samples first ... last - 1 from the last residuals, e(k) := w_static' phi(k) + sum_i w_i e(k - i), and
 * the same within bounds; eq. (4). */
static void expert_free_run(hsep_expert *self, const double rows[], uint64_t first, uint64_t last)
{
    const uint64_t n_static = self->n_static;
    const double *weights = hsep_at(self, self->weights), *lag_weights = weights + n_static;
    double *run = hsep_at(self, self->run), *unshrunk = hsep_at(self, self->unshrunk);
    rows += first * n_static;
    for (uint64_t k = first; k < last; k++, rows += n_static) {
        const uint64_t j = self->n - 1 - k;
        run[j] = hsep_recur(hsep_dot(weights, rows, n_static), lag_weights, run + j + 1, self->p);
        unshrunk[j] = isfinite(run[j]) ? hsep_clip(run[j], HSEP_EXPERT_LAG_BOUND * self->bound) : 0.0;
    }
}

/* Squares first ... last - 1 of the recursion's impulse response. */
static void expert_respond(hsep_expert *self, uint64_t first, uint64_t last)
{
    const uint64_t n = self->n;
    const double *lag_weights = hsep_at(self, self->weights) + self->n_static;
    double *response = hsep_at(self, self->response), *squares = hsep_at(self, self->squares);
    for (uint64_t k = first; k < last; k++) {
        const uint64_t j = n - 1 - k;
        response[j] = hsep_recur(k == 0 ? 1.0 : 0.0, lag_weights, response + j + 1, self->p);
        const double within = isnan(response[j]) ? HSEP_EXPERT_DIVERGED : hsep_clip(response[j], HSEP_EXPERT_DIVERGED);
        squares[k] = within * within;
    }
}

/* Largest variance that counts, m2. */
static double expert_most(const hsep_expert *self) { return HSEP_EXPERT_DIVERGED * self->bound * self->bound; }

/* Variances of the rows of count samples from k on, at most HSEP_GRAM_ABREAST. */
static void expert_vary_rows(hsep_expert *self, const double rows[], uint64_t k, uint64_t count)
{
    const uint64_t n_static = self->n_static, p = self->p;
    double *to = hsep_at(self, self->side_by_side), leverages[HSEP_GRAM_ABREAST];
    for (uint64_t c = 0; c < HSEP_GRAM_ABREAST; c++) {
        const uint64_t sample = k + (c < count ? c : count - 1); /* what is beyond is a copy */
        const double *row = rows + sample * n_static, *lags = hsep_at(self, self->unshrunk) + (self->n - sample);
        for (uint64_t i = 0; i < n_static; i++) {
            to[HSEP_GRAM_ABREAST * i + c] = row[i];
        }
        for (uint64_t i = 0; i < p; i++) {
            to[HSEP_GRAM_ABREAST * (n_static + i) + c] = lags[i];
        }
    }
    hsep_gram_leverages(hsep_at(self, self->factor), n_static + p, to, leverages);
    for (uint64_t c = 0; c < count; c++) {
        hsep_at(self, self->variances)[self->n - 1 - k - c] = self->variance * leverages[c];
    }
}

/* Variance of sample k of a prediction: that of the rows, carried through the impulse response. */
static double expert_variance(const hsep_expert *self, uint64_t k)
{
    const uint64_t j = self->n - 1 - k;
    const double *variances = hsep_at_const(self, self->variances) + j, most = expert_most(self);
    const double carried = self->p > 0 ? hsep_dot(hsep_at_const(self, self->squares), variances, k + 1) : variances[0];
    return isfinite(hsep_at_const(self, self->run)[j]) && carried < most ? carried : most;
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
        e_h[j] = hsep_clip(unshrunk[j], self->bound) * kept[j];
    }
}

HSEP_API void hsep_expert_vary(hsep_expert *self, const double rows[], uint64_t first, uint64_t last)
{
    double *kept = hsep_at(self, self->kept);
    if (self->p > 0) {
        expert_respond(self, first, last);
    }
    for (uint64_t k = first; k < last; k += HSEP_GRAM_ABREAST) {
        expert_vary_rows(self, rows, k, last - k < HSEP_GRAM_ABREAST ? last - k : HSEP_GRAM_ABREAST);
    }
    for (uint64_t k = first; k < last; k++) {
        kept[self->n - 1 - k] = expert_kept(self, expert_variance(self, k));
    }
    expert_shrink(self, self->n - last, self->n - first);
}

HSEP_API void hsep_expert_begin(hsep_expert *self, const double past[], double largest_square, double bound)
{
    self->largest_square = largest_square;
    self->bound = bound;
    memcpy(hsep_at(self, self->run) + self->n, past, (size_t)self->p * sizeof(double));
    memcpy(hsep_at(self, self->unshrunk) + self->n, past, (size_t)self->p * sizeof(double));
}

HSEP_API void hsep_expert_go_on(hsep_expert *self, const double rows[], uint64_t first, uint64_t last)
{
    expert_free_run(self, rows, first, last);
    hsep_expert_vary(self, rows, first, last);
}

HSEP_API void hsep_expert_predict(
    hsep_expert *self, const double rows[], const double past[], double largest_square, double bound, uint64_t varied)
{
    double *kept = hsep_at(self, self->kept);
    hsep_expert_begin(self, past, largest_square, bound);
    expert_free_run(self, rows, 0, self->n);
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

#include "hsep_change.h"

#include "hsep_penalised.h"

#include <math.h>
#include <string.h>

/* Fall of the log-likelihood ratio from its peak that tells a change. */
static const double change_fall = 60.0;

/* Rows of this run relative to those of earlier ones from which on there is little left to decide. */
static const double change_outweighed = 10.0;

/* Weight of the rows of earlier runs, relative to the one they have, that is tried beside it. */
static const double change_doubted = 0.1;

/* Log ratio of RMS errors, summed over windows, from which on it is taken; the factor by which it fades from window to
 * window; and the most that a window adds. */
static const double change_evidence = 1.5, change_memory = 0.9, change_evidence_of_a_window = 1.0;

/* Log-likelihood ratio of one plant to two from which on it takes more evidence, and how much: less of earlier runs may
 * be better by chance then. */
static const double change_support = 15.0, change_evidence_against_support = 3.0;

/* Weight of earlier runs, relative to that they began with, below which there is nothing left of them. */
static const double change_spent = 1e-6;

static const double change_least_square = 1e-300; /* m2, sum of squares that counts as 0 */

/* Fit of the features without lags to the rows of a factor. */
typedef struct {
    double cost, residual_sum; /* m2, with penalties and without */
    double log_det;            /* ln det R'R */
} change_fit;

/* Set what follows from the shape; return the bytes of the block. */
static double change_lay_out(hsep_change *self, const hsep_candidate_shape *shape)
{
    const uint64_t n_static = shape->n_static, n = n_static + shape->p;
    double end = HSEP_WORDS(hsep_change);
    self->n = n;
    self->n_static = n_static;
    self->before = hsep_take_block(&end, hsep_regression_size(n));
    self->after = hsep_take_block(&end, hsep_regression_size(n));
    self->solved = hsep_take_block(&end, hsep_regression_size(n_static));
    self->penalties = hsep_take(&end, (double)n_static);
    self->weights = hsep_take(&end, (double)n_static);
    self->less = hsep_take_block(&end, hsep_regression_size(n));
    self->candidate = hsep_take_block(&end, hsep_candidate_size(shape));
    return end * sizeof(double);
}

static hsep_regression *change_at(hsep_change *self, uint64_t offset)
{
    return (hsep_regression *)hsep_at(self, offset);
}

HSEP_API double hsep_change_size(const hsep_candidate_shape *shape) { return change_lay_out(&(hsep_change){0}, shape); }

HSEP_API hsep_candidate *hsep_change_candidate(hsep_change *self)
{
    return (hsep_candidate *)hsep_at(self, self->candidate);
}

HSEP_API void hsep_change_init(hsep_change *self, const hsep_candidate_shape *shape)
{
    memset(self, 0, (size_t)hsep_change_size(shape));
    (void)change_lay_out(self, shape);
    hsep_regression_init(change_at(self, self->before), self->n, HSEP_NO_PENALTY);
    hsep_regression_init(change_at(self, self->after), self->n, HSEP_NO_PENALTY);
    hsep_regression_init(change_at(self, self->solved), self->n_static, HSEP_NO_PENALTY);
    hsep_regression_init(change_at(self, self->less), self->n, HSEP_NO_PENALTY);
    hsep_candidate_init(hsep_change_candidate(self), shape);
}

HSEP_API int hsep_change_valid(const void *block, const hsep_candidate_shape *shape)
{
    hsep_change got;
    memcpy(&got, block, sizeof got);
    (void)change_lay_out(&got, shape); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 && got.active <= 1 && got.doubted <= 1 &&
           hsep_regression_valid(hsep_at_bytes(block, got.before), got.n) &&
           hsep_regression_valid(hsep_at_bytes(block, got.after), got.n) &&
           hsep_regression_valid(hsep_at_bytes(block, got.solved), got.n_static) &&
           hsep_regression_valid(hsep_at_bytes(block, got.less), got.n) &&
           hsep_candidate_valid(hsep_at_bytes(block, got.candidate), shape);
}

HSEP_API void hsep_change_begin(hsep_change *self, const hsep_regression *regression, double n_rows)
{
    memcpy(hsep_at(self, self->before), regression, (size_t)hsep_regression_size(self->n));
    hsep_regression_init(change_at(self, self->after), self->n, HSEP_NO_PENALTY);
    self->active = 1;
    self->doubted = 0;
    self->n_before = self->n_carried = n_rows;
    self->n_after = self->evidence = self->errors = self->errors_with_less = 0.0;
    self->log_ratio = self->peak = self->largest_square = self->largest = 0.0;
}

HSEP_API void hsep_change_discount(hsep_change *self, double kept)
{
    hsep_regression_discount(change_at(self, self->before), kept);
    hsep_regression_discount(change_at(self, self->after), kept);
    self->n_before *= kept;
    self->n_after *= kept;
}

HSEP_API double *hsep_change_row(hsep_change *self) { return hsep_regression_row(change_at(self, self->after)); }

HSEP_API void hsep_change_fold(hsep_change *self)
{
    hsep_regression_fold(change_at(self, self->after));
    self->n_after += 1.0;
}

HSEP_API void hsep_change_join(const hsep_change *self, hsep_regression *both)
{
    /* Rows that outweigh those of the factor are the dearer ones to fold. */
    const int later = self->n_after > self->n_before;
    const double *most = hsep_at_const(self, later ? self->after : self->before);
    memcpy(both, most, (size_t)hsep_regression_size(self->n));
    hsep_regression_fold_all(both, (const hsep_regression *)hsep_at_const(self, later ? self->before : self->after));
}

static change_fit change_fit_to(hsep_change *self, const hsep_regression *regression)
{
    const double *penalties = hsep_at(self, self->penalties), *weights = hsep_at(self, self->weights);
    hsep_regression *solved = change_at(self, self->solved);
    const double *inverse_d = hsep_at(solved, solved->inverse_d);
    change_fit fit = {0.0, 0.0, 0.0};
    fit.residual_sum = hsep_penalised_solve(regression, penalties, solved, hsep_at(self, self->weights));
    fit.cost = fit.residual_sum;
    for (uint64_t i = 0; i < self->n_static; i++) {
        fit.cost += penalties[i] * weights[i] * weights[i];
        fit.log_det -= log(inverse_d[i]);
    }
    return fit;
}

HSEP_API int hsep_change_tells(
    hsep_change *self, const hsep_regression *both, const double scales[], double variance, double least,
    double correlation)
{
    double *penalties = hsep_at(self, self->penalties), log_penalties = 0.0;
    for (uint64_t i = 0; i < self->n_static; i++) {
        penalties[i] = variance * correlation / (scales[i] * scales[i]);
        log_penalties += log(penalties[i]);
    }
    const change_fit A = change_fit_to(self, change_at(self, self->before));
    const change_fit B = change_fit_to(self, change_at(self, self->after));
    const change_fit AB = change_fit_to(self, both);
    const double pooled = (A.residual_sum + B.residual_sum) / (self->n_before + self->n_after);
    const double misfit = (AB.cost - A.cost - B.cost) / (fmax(pooled, least) * correlation);
    /* ln p(B | A) - ln p(B); a factor of penalties alone has ln det = sum ln penalties */
    const double log_ratio = -0.5 * (misfit + AB.log_det - A.log_det - B.log_det + log_penalties);
    self->log_ratio = log_ratio;
    self->peak = fmax(self->peak, log_ratio);
    return log_ratio < self->peak - change_fall;
}

HSEP_API void hsep_change_follow(hsep_change *self, double mean_square, double largest)
{
    self->largest_square = fmax(self->largest_square, mean_square);
    self->largest = fmax(self->largest, largest);
}

HSEP_API void hsep_change_predict(
    hsep_change *self, const hsep_candidate *like, const double scales[], double least_variance, const double rows[],
    const double past[], const hsep_residual_scale *scale)
{
    hsep_regression *less = change_at(self, self->less);
    hsep_candidate *candidate = hsep_change_candidate(self);
    memcpy(less, hsep_at(self, self->before), (size_t)hsep_regression_size(self->n));
    hsep_regression_discount(less, change_doubted);
    hsep_regression_fold_all(less, change_at(self, self->after));
    candidate->noise_variance = like->noise_variance;
    candidate->correlation = like->correlation;
    hsep_candidate_solve(candidate, less, scales, least_variance);
    hsep_candidate_predict(candidate, rows, past, scale, candidate->Np); /* no more of it is compared */
    self->doubted = 1;
}

HSEP_API int hsep_change_is_doubted(hsep_change *self, double error, double with_less, double physics)
{
    const double most = change_evidence_of_a_window, least = change_least_square;
    const double ratio = 0.5 * (log(fmax(error, least)) - log(fmax(with_less, least)));
    /* The part of the physics model's error that the better one explains, or of a worse error what is beyond that */
    const double beyond = fmax(1.0 - physics / fmax(error, least), 0.0);
    const double explained = fmax(1.0 - fmin(error, with_less) / fmax(physics, least), beyond);
    self->evidence = change_memory * self->evidence + explained * fmin(fmax(ratio, -most), most);
    self->errors = change_memory * self->errors + error;
    self->errors_with_less = change_memory * self->errors_with_less + with_less;
    const double needed = self->log_ratio < change_support ? change_evidence : change_evidence_against_support;
    return self->evidence > needed && self->errors_with_less < self->errors;
}

HSEP_API double hsep_change_doubt(hsep_change *self, hsep_regression *both)
{
    hsep_regression_discount(change_at(self, self->before), change_doubted);
    self->n_before *= change_doubted;
    self->evidence = self->errors = self->errors_with_less = 0.0;
    hsep_change_join(self, both);
    return self->n_before + self->n_after;
}

HSEP_API int hsep_change_is_over(const hsep_change *self)
{
    return self->n_after > change_outweighed * self->n_carried || self->n_before < change_spent * self->n_carried;
}

HSEP_API double hsep_change_keep_after(const hsep_change *self, hsep_regression *both)
{
    memcpy(both, hsep_at_const(self, self->after), (size_t)hsep_regression_size(self->n));
    return self->n_after;
}

#include "hsep_change.h"

#include "hsep_penalised.h"

#include <math.h>
#include <string.h>

/* Fall of the log-likelihood ratio from its peak that tells a change. */
static const double change_fall = 60.0;

/* Rows of this run relative to those of earlier ones from which on there is little left to decide. */
static const double change_outweighed = 10.0;

/* Fit of the features without lags to the rows of a factor. */
typedef struct {
    double cost, residual_sum; /* m2, with penalties and without */
    double log_det;            /* ln det R'R */
} change_fit;

/* Set what follows from the numbers of features; return the bytes of the block. */
static double change_lay_out(hsep_change *self, uint64_t n_static, uint64_t n)
{
    double end = HSEP_WORDS(hsep_change);
    self->n = n;
    self->n_static = n_static;
    self->before = hsep_take_block(&end, hsep_regression_size(n));
    self->after = hsep_take_block(&end, hsep_regression_size(n));
    self->solved = hsep_take_block(&end, hsep_regression_size(n_static));
    self->penalties = hsep_take(&end, (double)n_static);
    self->weights = hsep_take(&end, (double)n_static);
    return end * sizeof(double);
}

static hsep_regression *change_at(hsep_change *self, uint64_t offset)
{
    return (hsep_regression *)hsep_at(self, offset);
}

HSEP_API double hsep_change_size(uint64_t n_static, uint64_t n)
{
    return change_lay_out(&(hsep_change){0}, n_static, n);
}

HSEP_API void hsep_change_init(hsep_change *self, uint64_t n_static, uint64_t n)
{
    memset(self, 0, (size_t)hsep_change_size(n_static, n));
    (void)change_lay_out(self, n_static, n);
    hsep_regression_init(change_at(self, self->before), n, HSEP_NO_PENALTY);
    hsep_regression_init(change_at(self, self->after), n, HSEP_NO_PENALTY);
    hsep_regression_init(change_at(self, self->solved), n_static, HSEP_NO_PENALTY);
}

HSEP_API int hsep_change_valid(const void *block, uint64_t n_static, uint64_t n)
{
    hsep_change got;
    memcpy(&got, block, sizeof got);
    (void)change_lay_out(&got, n_static, n); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 && got.active <= 1 &&
           hsep_regression_valid(hsep_at_bytes(block, got.before), n) &&
           hsep_regression_valid(hsep_at_bytes(block, got.after), n) &&
           hsep_regression_valid(hsep_at_bytes(block, got.solved), n_static);
}

HSEP_API void hsep_change_begin(hsep_change *self, const hsep_regression *regression, double n_rows)
{
    hsep_change_init(self, self->n_static, self->n);
    memcpy(hsep_at(self, self->before), regression, (size_t)hsep_regression_size(self->n));
    self->active = 1;
    self->n_before = n_rows;
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
    self->peak = fmax(self->peak, log_ratio);
    return log_ratio < self->peak - change_fall;
}

HSEP_API void hsep_change_follow(hsep_change *self, double mean_square, double largest)
{
    self->largest_square = fmax(self->largest_square, mean_square);
    self->largest = fmax(self->largest, largest);
}

HSEP_API int hsep_change_is_over(const hsep_change *self) { return self->n_after > change_outweighed * self->n_before; }

HSEP_API double hsep_change_keep_after(const hsep_change *self, hsep_regression *both)
{
    memcpy(both, hsep_at_const(self, self->after), (size_t)hsep_regression_size(self->n));
    return self->n_after;
}

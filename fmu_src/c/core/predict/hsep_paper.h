/* The paper's residual model: a ridge regression of e_pb on the features phi, eqs. (4) to (6); as predict/paper.py.
 *
 *   phi(k) = [1 | x_pb(k) ... x_pb(k-q) | e_pb(k-1) ... e_pb(k-p)]
 *
 * Signals are kept newest first: sample k of n is at place n - 1 - k, its lag i at i places further. Every sample is a
 * row, folded when it is measured.
 */
#ifndef HSEP_PAPER_H
#define HSEP_PAPER_H

#include "hsep_regression.h"
#include "hsep_window.h"

/* e(k) = bias + sum_i w_x,i x(k - i) + sum_i w_e,i e(k - i) */
typedef struct {
    const hsep_real *w_x; /* (q + 1,), lags 0 ... q */
    const hsep_real *w_e; /* (p,), lags 1 ... p */
    hsep_int p, q;
    hsep_real bias; /* m */
} hsep_recursion;

typedef struct {
    hsep_int p, q;     /* lags of e_pb and of x_pb */
    hsep_int features; /* 1 + (q + 1) + p: their number, and the place of the target in a row */
    hsep_int weights;  /* (features,) w */
    hsep_int regression;
} hsep_paper;
HSEP_ASSERT_WORDS(hsep_paper, 5);

static inline hsep_regression *hsep_paper_regression(hsep_paper *self) { return hsep_part(self, self->regression); }

static inline hsep_real hsep_paper_lay_out(hsep_paper *self, const hsep_predictor_settings *settings)
{
    hsep_real end = HSEP_WORDS(hsep_paper);
    self->p = settings->p;
    self->q = settings->q;
    self->features = 2 + settings->q + settings->p;
    self->weights = hsep_take(&end, (hsep_real)self->features);
    self->regression = hsep_take_block(&end, hsep_regression_size(self->features));
    return end * sizeof(hsep_real);
}

/* Fill the block, which is 0. */
static inline void hsep_paper_init(hsep_paper *self, const hsep_predictor_settings *settings)
{
    (void)hsep_paper_lay_out(self, settings);
    hsep_regression_init(hsep_paper_regression(self), self->features, settings->lambda);
}

/* The learned recursion, with its bias or without. */
static inline hsep_recursion hsep_paper_recursion(const hsep_paper *self, int with_bias)
{
    const hsep_real *w = hsep_at_const(self, self->weights), *w_x = w + 1;
    return (hsep_recursion){
        .w_x = w_x, .w_e = w_x + (self->q + 1), .p = self->p, .q = self->q, .bias = with_bias ? w[0] : 0.0};
}

/* Fold the row of a sample into the regression; eqs. (5) and (6). x, e: m, x_pb and e_pb of the window from this sample
 * on, and before it. Costs a hsep_regression_fold. */
static inline void hsep_paper_learn(hsep_paper *self, const hsep_real x[], const hsep_real e[])
{
    hsep_real *row = hsep_regression_row(hsep_paper_regression(self)), *lags = row + 2 + self->q;
    row[0] = 1.0;
    hsep_copy(row + 1, x, self->q + 1);
    hsep_copy(lags, e + 1, self->p);
    row[self->features] = e[0]; /* its target e_pb(k) */
    hsep_regression_fold(hsep_paper_regression(self));
}

/* Run over the samples first ... last - 1 of n. x: (n + q,), e: (n + p,), m; both hold the past after the window.
 * Cost: p + q + 1 multiply-adds a sample. */
static inline void hsep_recursion_run(
    const hsep_recursion *self, const hsep_real x[], hsep_real e[], hsep_int n, hsep_int first, hsep_int last)
{
    for (hsep_int k = first; k < last; k++) {
        const hsep_int j = n - 1 - k;
        e[j] = self->bias + hsep_dot(self->w_x, x + j, self->q + 1) + hsep_dot(self->w_e, e + j + 1, self->p);
    }
}

#endif

/* Test of a warm run for a plant that has changed since it was learned.
 *
 * The rows of earlier runs, A, and those of this one, B, follow one model, or the plant has changed and each has its
 * own. With normal priors of the weights the ratio of their marginal likelihoods follows from the factors of A, B and
 * of both (Chow 1960, with priors in place of degrees of freedom). It rises while what was carried over helps, and
 * falls once it contradicts what is measured: a large fall from its peak tells the change (Page 1954). The features
 * without lags decide, as lags would adapt to what contradicts.
 *
 * Memory is one block, without pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_CHANGE_H
#define HSEP_CHANGE_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_regression.h"

#include <stdint.h>

typedef struct {
    uint64_t n, n_static;        /* features, those without lags first */
    uint64_t active;             /* whether earlier runs are compared with this one */
    double n_before, n_after;    /* rows of earlier runs and of this one, weighted */
    double peak;                 /* largest log-likelihood ratio so far of one plant to two, at least 0 */
    double largest_square;       /* m2, largest mean square of the residual over a window of this run */
    double largest;              /* m, its largest magnitude in this run */
    uint64_t before, after;      /* regressions: rows of earlier runs, and of this one */
    uint64_t solved;             /* regression of the features without lags, with penalties */
    uint64_t penalties, weights; /* (n_static,) */
} hsep_change;

HSEP_ASSERT_WORDS(hsep_change, 13);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_change_size(uint64_t n_static, uint64_t n);

/* Fill the block, with nothing to compare. */
HSEP_API void hsep_change_init(hsep_change *self, uint64_t n_static, uint64_t n);

/* Whether a block, in any alignment, is one that hsep_change_init with these numbers began. */
HSEP_API int hsep_change_valid(const void *block, uint64_t n_static, uint64_t n);

/* Begin to compare with earlier runs. regression: factor of their rows; n_rows: their weight, > 0. */
HSEP_API void hsep_change_begin(hsep_change *self, const hsep_regression *regression, double n_rows);

/* Weigh all rows so far by kept. */
HSEP_API void hsep_change_discount(hsep_change *self, double kept);

/* Where the next row of this run goes, (n + 1,), and take it in. Cost: that of hsep_regression_fold. */
HSEP_API double *hsep_change_row(hsep_change *self);
HSEP_API void hsep_change_fold(hsep_change *self);

/* Put the rows of all runs into a regression. Cost: that of hsep_regression_fold_all. */
HSEP_API void hsep_change_join(const hsep_change *self, hsep_regression *both);

/* Whether the rows so far tell that the plant is another one. both: factor of all rows; scales: (n_static,) prior
 * standard deviations of the weights; variance, least: m2, of the noise that the penalties come from, and its least;
 * correlation: rows that count as one.
 * Cost: three times that of hsep_penalised_solve for n_static weights. */
HSEP_API int hsep_change_tells(
    hsep_change *self, const hsep_regression *both, const double scales[], double variance, double least,
    double correlation);

/* Follow the size of the residuals of this run: mean square, m2, and largest magnitude, m, of a window. */
HSEP_API void hsep_change_follow(hsep_change *self, double mean_square, double largest);

/* Whether this run outweighs the earlier ones. */
HSEP_API int hsep_change_is_over(const hsep_change *self);

/* Put the rows of this run alone into the regression of all rows; return their weight. */
HSEP_API double hsep_change_keep_after(const hsep_change *self, hsep_regression *both);

#endif

/* Test of a warm run for a plant that has changed since it was learned.
 *
 * The rows of earlier runs, A, and those of this one, B, follow one model, or the plant has changed and each has its
 * own. With normal priors of the weights the ratio of their marginal likelihoods follows from the factors of A, B and
 * of both (Chow 1960, with priors in place of degrees of freedom). It rises while what was carried over helps, and
 * falls once it contradicts what is measured: a large fall from its peak tells the change (Page 1954). The features
 * without lags decide, as lags would adapt to what contradicts.
 *
 * Where rows are alike, or the model with lags alone tells the difference, likelihood says little. So each window is
 * also predicted, by a candidate of its own, with a tenth of the weight of A. While that is better, window after
 * window, A is given this tenth.
 *
 * Memory is one block, without pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_CHANGE_H
#define HSEP_CHANGE_H

#include "hsep_api.h"
#include "hsep_candidate.h"
#include "hsep_layout.h"
#include "hsep_regression.h"

#include <stdint.h>

typedef struct {
    uint64_t n, n_static;        /* features, those without lags first */
    uint64_t active;             /* whether earlier runs are compared with this one */
    double n_before, n_after;    /* rows of earlier runs and of this one, weighted */
    double n_carried;            /* of earlier runs, when this one began */
    double evidence;             /* that less weight of earlier runs is better: log ratio of RMS errors, which fades */
    double errors;               /* m2, sum of squared errors with all rows, which fades, */
    double errors_with_less;     /* and with less weight of earlier runs */
    uint64_t doubted;            /* whether the window is predicted with less weight of them */
    double log_ratio;            /* log-likelihood ratio of one plant to two, as hsep_change_tells found it */
    double peak;                 /* its largest so far, at least 0 */
    double largest_square;       /* m2, largest mean square of the residual over a window of this run */
    double largest;              /* m, its largest magnitude in this run */
    uint64_t before, after;      /* regressions: rows of earlier runs, and of this one */
    uint64_t solved;             /* regression of the features without lags, with penalties */
    uint64_t penalties, weights; /* (n_static,) */
    uint64_t less, candidate; /* regression with less weight of earlier runs, and the candidate that predicts by it */
} hsep_change;

HSEP_ASSERT_WORDS(hsep_change, 21);

/* Bytes of the block, counted in double so that no size can overflow. shape: of the candidate that doubts. */
HSEP_API double hsep_change_size(const hsep_candidate_shape *shape);

/* Fill the block, with nothing to compare. */
HSEP_API void hsep_change_init(hsep_change *self, const hsep_candidate_shape *shape);

/* Whether a block, in any alignment, is one that hsep_change_init with this shape began. */
HSEP_API int hsep_change_valid(const void *block, const hsep_candidate_shape *shape);

/* The candidate that predicts with less weight of earlier runs. */
HSEP_API hsep_candidate *hsep_change_candidate(hsep_change *self);

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

/* Predict the window, as hsep_candidate_predict, with less weight of earlier runs, by the noise and correlation of
 * another candidate. Cost: that of hsep_change_join, of hsep_candidate_solve and of hsep_candidate_predict. */
HSEP_API void hsep_change_predict(
    hsep_change *self, const hsep_candidate *like, const double scales[], double least_variance, const double rows[],
    const double past[], const hsep_residual_scale *scale);

/* Whether earlier runs had better have less weight, as the windows so far show; after hsep_change_tells. Sums of
 * squared errors of a window, m2: predicted with all rows, with less weight of the earlier ones, and by the physics
 * model. Where all three are alike there is nothing to compare. */
HSEP_API int hsep_change_is_doubted(hsep_change *self, double error, double with_less, double physics);

/* Give earlier runs that weight; return the weight of all rows. */
HSEP_API double hsep_change_doubt(hsep_change *self, hsep_regression *both);

/* Follow the size of the residuals of this run: mean square, m2, and largest magnitude, m, of a window. */
HSEP_API void hsep_change_follow(hsep_change *self, double mean_square, double largest);

/* Whether this run outweighs the earlier ones, or nothing of them is left. */
HSEP_API int hsep_change_is_over(const hsep_change *self);

/* Put the rows of this run alone into the regression of all rows; return their weight. */
HSEP_API double hsep_change_keep_after(const hsep_change *self, hsep_regression *both);

#endif

/* Candidate model of the residual: the features without lags with some lags, trusted as far as its own variance allows.
 *
 * Weights have normal priors, so the variance of w' phi is known; it is carried through the recursion's impulse
 * response. A prediction e of variance tau^2 is shrunk to e v / (v + 2 tau^2). Here v is the mean square that the
 * residual may have: the recent one, or what the prediction's own is beyond tau^2. At a first motion, a first reversal
 * or in a region not seen yet the physics model remains.
 *
 * Signals are kept newest first: of the n samples that are predicted, sample k is at place n - 1 - k. The first Np of
 * them are the window, which is measured then. Memory is one block, without pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_CANDIDATE_H
#define HSEP_CANDIDATE_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_regression.h"

#include <stdint.h>

/* Size of the residuals so far. */
typedef struct {
    double recent;         /* m2, recent mean square */
    double largest_square; /* m2, largest mean square of a window */
    double largest;        /* m, largest magnitude */
} hsep_residual_scale;

typedef struct {
    uint64_t Np, n;         /* samples of a window, and of a prediction, n >= Np */
    uint64_t n_static, p;   /* features without lags, lags */
    double correlation_max; /* beyond which the penalty does not grow; 1: rows are taken as independent */
} hsep_candidate_shape;

typedef struct {
    uint64_t Np, n, n_static, p;
    double correlation_max;
    double noise_variance; /* m2, of a row about the model; 0 until a window is measured */
    double correlation;    /* rows that count as one: errors of neighbouring rows are alike */
    double variance;       /* m2, of the noise as the weights were solved */
    double residual_sum;   /* m2, of the rows so far about these weights */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t priors;      /* (n_static + p,) prior standard deviations, then penalties of the weights */
    uint64_t weights;     /* (n_static + p,) */
    uint64_t run;         /* (n + p,) m, the recursion, behind it measured residuals */
    uint64_t unshrunk;    /* (n + p,) m, the same within bounds */
    uint64_t e_h;         /* (n,) m, shrunk */
    uint64_t response;    /* (n + p,) the recursion's impulse response, behind it 0 */
    uint64_t squares;     /* (n,) its squares, oldest first */
    uint64_t leverage;    /* (n,) m2, variance of the rows */
    uint64_t spread;      /* (n,) m2, variance of the prediction */
    uint64_t mean_square; /* (n,) m2, that the residual may have */
    uint64_t solved;      /* the regression with penalties */
} hsep_candidate;

HSEP_ASSERT_WORDS(hsep_residual_scale, 3);
HSEP_ASSERT_WORDS(hsep_candidate_shape, 5);
HSEP_ASSERT_WORDS(hsep_candidate, 20);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_candidate_size(const hsep_candidate_shape *shape);

/* Fill the block, with nothing learned. */
HSEP_API void hsep_candidate_init(hsep_candidate *self, const hsep_candidate_shape *shape);

/* Whether a block, in any alignment, is one that hsep_candidate_init with this shape began. */
HSEP_API int hsep_candidate_valid(const void *block, const hsep_candidate_shape *shape);

/* Solve for the weights from all rows. static_scales: (n_static,) prior standard deviations of the weights of the
 * features without lags; least_variance: of the noise, m2. Cost: that of hsep_penalised_solve. */
HSEP_API void hsep_candidate_solve(
    hsep_candidate *self, const hsep_regression *regression, const double static_scales[], double least_variance);

/* Predict n samples in free run. rows: (n, n_static), sample after sample; past: (p,) m, the last residuals; varied:
 * samples whose variance is computed, the first ones, while those behind them are taken as unknown; 0: the variance,
 * and with it the shrinking, stays that of the last prediction. Cost: n (n_static + p) multiply-adds, and that of
 * hsep_candidate_vary. */
HSEP_API void hsep_candidate_predict(
    hsep_candidate *self, const double rows[], const double past[], const hsep_residual_scale *scale, uint64_t varied);

/* Compute the variance of samples first ... last - 1 of that prediction, if those before them have theirs; the next
 * one may hold it. Cost for each: that of hsep_penalised_leverage, and last multiply-adds. */
HSEP_API void hsep_candidate_vary(
    hsep_candidate *self, const double rows[], const hsep_residual_scale *scale, uint64_t first, uint64_t last);

/* Compute these variances, and predict these samples with them. */
HSEP_API void hsep_candidate_go_on(
    hsep_candidate *self, const double rows[], const hsep_residual_scale *scale, uint64_t first, uint64_t last);

/* Estimate the correlation from the errors of a window, (Np,), m, that has been measured; accepted: (Np,), 1 where it
 * counts. */
HSEP_API void hsep_candidate_judge(hsep_candidate *self, const double measured[], const double accepted[]);

/* Mean square error of the window relative to the one that was expected. */
HSEP_API double hsep_candidate_surprise(const hsep_candidate *self, const double measured[], const double accepted[]);

/* Prediction of the window, (Np,), m. */
HSEP_API const double *hsep_candidate_prediction(const hsep_candidate *self);

/* Part of the recursion that the prediction of n samples has, at place j: what shrinking and bounds leave of it. */
HSEP_API double hsep_candidate_shrink(const hsep_candidate *self, uint64_t j);

#endif

/* Expert of the residual: a regression on static features and lags with normal priors, trusted as far as its own
 * variance allows.
 *
 * Weights have normal priors, so the variance of w' phi is known; it is carried through the recursion's impulse
 * response. A prediction of variance tau^2 is shrunk by v / (v + tau^2), v being the largest mean square of a window:
 * at a first motion, a first reversal or in a region not seen yet the physics model remains.
 *
 * Signals are kept newest first: of the n samples that are predicted, sample k is at place n - 1 - k. The first Np of
 * them are the window, which is measured then. Memory is one block, without pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_EXPERT_H
#define HSEP_EXPERT_H

#include "hsep_api.h"
#include "hsep_gram.h"
#include "hsep_layout.h"

#include <stdint.h>

/* Size of the residuals so far. */
typedef struct {
    double largest_square; /* m2, largest mean square of a window */
    double largest;        /* m, largest magnitude */
} hsep_residual_scale;

typedef struct {
    uint64_t Np, n;       /* samples of a window, and of a prediction, n >= Np */
    uint64_t n_static, p; /* features without lags, lags */
} hsep_expert_shape;

typedef struct {
    uint64_t Np, n, n_static, p;
    double noise_variance; /* m2, of a row about the model; 0 until it is known */
    double correlation;    /* rows that count as one: errors of neighbouring rows are alike */
    double variance;       /* m2, of the noise that the penalties come from */
    double rows_variance;  /* m2, mean square of the rows about the weights */
    double largest_square; /* m2, largest mean square of a window, and */
    double bound;          /* m, bound on the prediction, as it was made */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t lag_scales;   /* (p,) prior standard deviations of the weights of the lags */
    uint64_t penalties;    /* (n_static + p,) of the weights */
    uint64_t weights;      /* (n_static + p,) */
    uint64_t run;          /* (n + p,) m, the recursion, behind it measured residuals */
    uint64_t unshrunk;     /* (n + p,) m, the same within bounds */
    uint64_t e_h;          /* (n,) m, shrunk by its variance, and bounded */
    uint64_t kept;         /* (n,) what the variance leaves of it */
    uint64_t response;     /* (n + p,) the recursion's impulse response, behind it 0 */
    uint64_t squares;      /* (n,) its squares, oldest first */
    uint64_t variances;    /* (n,) m2, of the rows */
    uint64_t factor;       /* triangle of n_static + p + 1 rows: that of the solution */
    uint64_t side_by_side; /* (n_static + p + 1, HSEP_GRAM_ABREAST) rows whose variances are computed, work */
} hsep_expert;

HSEP_ASSERT_WORDS(hsep_residual_scale, 2);
HSEP_ASSERT_WORDS(hsep_expert_shape, 4);
HSEP_ASSERT_WORDS(hsep_expert, 22);

/* Take another window of residuals, (n,), m, into a scale; accepted: (n,), 1 where it counts; count: how many do. */
HSEP_API void hsep_residual_scale_follow(
    hsep_residual_scale *self, const double residuals[], const double accepted[], uint64_t n, double count);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_expert_size(const hsep_expert_shape *shape);

/* Fill the block, with nothing learned. */
HSEP_API void hsep_expert_init(hsep_expert *self, const hsep_expert_shape *shape);

/* Whether a block, in any alignment, is one that hsep_expert_init with this shape began. */
HSEP_API int hsep_expert_valid(const void *block, const hsep_expert_shape *shape);

/* What the weights are solved with. */
typedef struct {
    const hsep_gram *gram;  /* of rows whose first features are those of the expert, */
    const hsep_gram *other; /* more of them, settled, or NULL, */
    double weight;          /* and the weight of these */
    double n_rows;          /* and their number, weighted */
    const double *scales;   /* (n_static,) prior standard deviations of the weights without lags */
    double first, least;    /* m2, variance of the noise while it is not known, and the least one */
} hsep_expert_evidence;

/* Solve for the weights from all rows. Cost: that of hsep_gram_solve. */
HSEP_API void hsep_expert_solve(hsep_expert *self, const hsep_expert_evidence *evidence);

/* Predict n samples in free run. rows: (n, n_static), sample after sample; past: (p,) m, the last residuals; bound: m,
 * on the prediction; varied: samples whose variance is computed, the first ones, while those behind them are taken as
 * unknown; 0: what the variance leaves stays that of the last prediction. Cost: n (n_static + p) multiply-adds, and
 * that of hsep_expert_vary. */
HSEP_API void hsep_expert_predict(
    hsep_expert *self, const double rows[], const double past[], double largest_square, double bound, uint64_t varied);

/* Predict them part by part: begin, then go on with samples first ... last - 1, first being 0, or where the last call
 * ended; the result is the same as with varied = n. */
HSEP_API void hsep_expert_begin(hsep_expert *self, const double past[], double largest_square, double bound);
HSEP_API void hsep_expert_go_on(hsep_expert *self, const double rows[], uint64_t first, uint64_t last);

/* Compute the variance of samples first ... last - 1 of that prediction, if those before them have theirs, and shrink
 * them by it. Cost for each: that of hsep_gram_leverages, four at a time, and last multiply-adds. */
HSEP_API void hsep_expert_vary(hsep_expert *self, const double rows[], uint64_t first, uint64_t last);

/* Estimate noise and correlation from the errors of a window, (Np,), m, that has been measured; accepted: (Np,), 1
 * where it counts, which one does at least; given: m2, variance of the noise, if it is known; else 0. */
HSEP_API void hsep_expert_judge(hsep_expert *self, const double measured[], const double accepted[], double given);

/* What shrinking and bounds leave of the recursion at place j. */
HSEP_API double hsep_expert_shrink(const hsep_expert *self, uint64_t j);

#endif

/* Expert of the residual: a regression on static features and lags with normal priors, counted as far as its own
 * variance allows; as predict/averaging/experts.py, which says how. Signals are kept newest first (hsep_window.h). */
#ifndef HSEP_EXPERTS_H
#define HSEP_EXPERTS_H

#include "hsep_predict_constants.h"
#include "hsep_solution.h"
#include "hsep_warm_start.h"

/* Size of the residuals so far. */
typedef struct {
    hsep_real largest_square; /* m2, largest mean square of a window, */
    hsep_real largest_move;   /* m2, and about the level of its run */
    hsep_real largest;        /* m, largest magnitude */
} hsep_residual_scale;

/* What is known of the errors of an expert. */
typedef struct {
    hsep_real noise_variance; /* m2, of a row about the model; 0 until it is known */
    hsep_real correlation;    /* rows that count as one: errors of neighbouring rows are alike */
} hsep_expert_errors;

typedef struct {
    hsep_int Np, n;           /* samples of a window, and of a prediction, n >= Np */
    hsep_int n_static, p;     /* features without lags, lags */
    hsep_real variance;       /* m2, of the noise that the penalties come from */
    hsep_real rows_variance;  /* m2, mean square of the rows about the weights */
    hsep_real largest_square; /* m2, largest mean square of a window, and */
    hsep_real bound;          /* m, bound on the prediction, as it was made */
    hsep_int lag_scales;      /* (p,) prior standard deviations of the weights of the lags */
    hsep_int run;             /* (n + p,) m, the recursion, after it measured residuals */
    hsep_int unshrunk;        /* (n + p,) m, the same within bounds */
    hsep_int e_h;             /* (n,) m, shrunk by its variance, and bounded */
    hsep_int shrinkage;       /* (n,) what the variance leaves of it */
    hsep_int response;        /* (n + p,) the recursion's impulse response, after it 0 */
    hsep_int squares;         /* (n,) its squares, oldest first */
    hsep_int variances;       /* (n,) m2, of the rows */
    hsep_int solution;        /* hsep_solution, whose head are the lags */
} hsep_expert;

HSEP_ASSERT_WORDS(hsep_residual_scale, 3);
HSEP_ASSERT_WORDS(hsep_expert_errors, 2);
HSEP_ASSERT_WORDS(hsep_expert, 17);

/* Take a window of residuals, (n,), m, into a scale; accepted: (n,), 1 for the count that do; level: m, of the run. */
HSEP_API void hsep_residual_scale_follow(
    hsep_residual_scale *self, const hsep_real residuals[], const hsep_real accepted[], hsep_int n, hsep_real count,
    hsep_real level);

/* Effect that a feature may have, m: less than the residuals where most of them is an offset. */
HSEP_API hsep_real hsep_residual_scale_effect(const hsep_residual_scale *self);

/* Samples at the end of a window over which its solution may go on while rows come. */
static inline hsep_int hsep_expert_ahead(hsep_int Np) { return hsep_min(Np / 2, HSEP_AVERAGING_AHEAD); }

/* shape: its samples, features and lags; all else is 0, and is set by hsep_expert_lay_out. */
HSEP_API hsep_real hsep_expert_lay_out(hsep_expert *shape);
HSEP_API void hsep_expert_init(hsep_expert *self, hsep_expert shape);

static inline hsep_solution *hsep_expert_solution(hsep_expert *self) { return hsep_part(self, self->solution); }

/* Weights of the features without lags, then of the lags, (n_static + p,). */
static inline const hsep_real *hsep_expert_weights(const hsep_expert *self)
{
    const hsep_solution *solution = hsep_part_const(self, self->solution);
    return hsep_at_const(solution, solution->weights);
}

/* Take the penalties that the next weights are solved for with from the rows so far, earlier runs' weighed by
 * weight. first, least: m2, variance of the noise while it is not known, and the least one. */
HSEP_API void hsep_expert_prepare(
    hsep_expert *self, hsep_warm_start *evidence, hsep_real weight, const hsep_expert_errors *errors, hsep_real first,
    hsep_real least);

/* Solve for the weights. n_rows: of all rows, weighted; scales: (n_static,) prior standard deviations of the weights
 * without lags. */
HSEP_API void hsep_expert_solve(hsep_expert *self, hsep_real n_rows, const hsep_real scales[]);

/* Begin a prediction. past: (p,) m, the last residuals; bound: m, on the prediction. */
HSEP_API void hsep_expert_begin(hsep_expert *self, const hsep_real past[], hsep_real largest_square, hsep_real bound);

/* Predict samples first ... last - 1 in free run, and shrink them by their variances; first is 0, or where the last
 * call ended. rows: (n, n_static), sample after sample. The row of the first of every stride samples, from first on,
 * counts for their variances; stride = 0: shrinking stays as in the last prediction. A sample costs n_static + p and,
 * for its variance, last multiply-adds, and each row that counts a quarter of hsep_solution_leverages. */
HSEP_API void hsep_expert_predict(
    hsep_expert *self, const hsep_real rows[], hsep_int first, hsep_int last, hsep_int stride);

/* Estimate noise and correlation from the errors of the first n samples of a window. measured: (Np,) m; accepted:
 * (Np,), 1 where it counts, which one of them does at least; given: m2, known variance of the noise, else 0. */
HSEP_API void hsep_expert_judge(
    const hsep_expert *self, hsep_expert_errors *errors, const hsep_real measured[], const hsep_real accepted[],
    hsep_int n, hsep_real given);

#endif

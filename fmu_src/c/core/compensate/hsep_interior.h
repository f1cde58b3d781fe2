/* Primal-dual interior-point solver for a bounded plan: Mehrotra's predictor-corrector method (1992), a part of
 * a step a call:
 *  min 1/2 x' P x - v' x  with  low <= A x <= high, A being hsep_splines_rows of hsep_knots_widen.
 *
 * An iterate stays inside the bounds once a full step has reached them. What is found after fewer steps may exceed
 * them: the iterate that was farthest inside is kept beside it.
 */
#ifndef HSEP_INTERIOR_H
#define HSEP_INTERIOR_H

#include "hsep_splines.h"

/* Where the solver ends. */
typedef struct {
    hsep_real mu;            /* complementarity mu at the end, as a share of the cost per bound */
    hsep_real dual_residual; /* dual residual at the end, as a share of its largest term */
    hsep_real margin;        /* shares by which its bounds are tighter, and may be exceeded at the end */
    hsep_int steps;          /* at most */
    hsep_real first_mu;      /* mu at the beginning, as that at the end */
} hsep_tolerance;

typedef struct {
    hsep_tolerance tolerance;
    hsep_knots knots; /* of x, (m,); the splines before them are fixed */
    hsep_int steps;   /* done for this plan */
    hsep_int half;    /* whether half of another one is */
    hsep_int solved;  /* whether x is the solution */
    hsep_real mu;     /* m2, at x */
    hsep_real cost;   /* m2, scale of the cost per bound */
    hsep_real rho;    /* 1/m2, proximal regularisation of the multipliers */
    hsep_real beyond; /* shares, by how much inner exceeds the worst bound; the margin: there is none */
    /* followed by arrays, see interior_lay_out */
} hsep_interior;
HSEP_ASSERT_WORDS(hsep_interior, 21);

HSEP_API hsep_real hsep_interior_size(hsep_int preview, hsep_int n); /* bytes of the block, counted as a number */

/* Where the problem goes before hsep_interior_begin; of v, x and inner the first m entries count. */
typedef struct {
    hsep_real *v;          /* (n,) m */
    hsep_real *x;          /* (n,) m, start and result */
    hsep_real *inner;      /* (n,) m, result: the iterate farthest inside the bounds without their margin, or NULL */
    hsep_real *low, *high; /* (4 preview,), in shares */
    hsep_real *c;          /* (n + 2 HSEP_KNOTS_NEAR,) work, before and behind it, */
    hsep_real *products;   /* (n, HSEP_KNOTS_WIDTH) for products of splines, */
    hsep_real *factor;     /* and for a triangle of n rows */
} hsep_problem;

HSEP_API hsep_problem hsep_interior_problem(hsep_interior *self, const hsep_splines *splines);

/* Begin with x and the bounds as they are. knots: of the last splines; P: a triangle of m rows; cost: its scale, m2. */
HSEP_API void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const hsep_knots *knots, const hsep_real P[], hsep_real cost,
    const hsep_tolerance *tolerance);

/* Do a part of a step: its residuals, a third of its factor, its predictor or its corrector. P: as in
 * hsep_interior_begin. Returns whether the plan is solved. Cost: m^3 / 6 multiply-adds for the factor, m^2 before and
 * 2 m^2 after it, and about 900 operations and 8 divisions a sample of the plan in all. */
HSEP_API int hsep_interior_advance(hsep_interior *self, const hsep_splines *splines, const hsep_real P[]);

#endif

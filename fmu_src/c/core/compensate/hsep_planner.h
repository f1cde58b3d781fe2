/* Receding-horizon planner of the modified command, x_dm = x_d + delta, over its horizon. delta is a sum of cubic
 * B-splines (hsep_splines.h), each filtered through a linear model (the filtered-basis-functions method: Ramani, Duan,
 * Okwudire and Ulsoy 2017), so that the model's response follows x_d within the drive's limits.
 *
 * Of a plan only the splines that begin in the first window are applied; hsep_planner_next advances by a window, and
 * the next plan starts from the remainder, which returns to x_d within the limits. A plan whose unconstrained minimum
 * is feasible is found at once; another one is solved in steps of equal cost.
 */
#ifndef HSEP_PLANNER_H
#define HSEP_PLANNER_H

#include "hsep_splines.h"
#include "hsep_window.h"

typedef struct {
    hsep_int Np;
    hsep_int n_pinned; /* splines of a bounded plan that stay as they were */
    hsep_int no_reversal;
    hsep_int averaging; /* whether plans are of the averaged model, */
    hsep_int steps;     /* and those of the solver at most */
    hsep_real jerk_weight;
    hsep_real delta_before[3], x_d_before[3]; /* m, of the samples before the plan */
    hsep_int c;                               /* (3 + n,) m, coefficients */
    hsep_int low, high; /* (4 horizon,) bounds of the rows of a change of the remainder of the last plan, in shares */
    hsep_int third;     /* (horizon,) m, third differences of the remainder of the last plan */
    hsep_int P;         /* triangle of n rows */
    hsep_int splines, interior;
    hsep_knots knots;  /* of changes of the last plan, */
    hsep_knots solved; /* and of this cost */
    hsep_int stop;     /* of plans that are longer than what is known; 0: none is */
} hsep_planner;
HSEP_ASSERT_WORDS(hsep_planner, 38);

/* The splines of a plan; hsep_splines_shape is to be filtered. */
static inline const hsep_splines *hsep_planner_splines(const hsep_planner *self)
{
    return hsep_part_const(self, self->splines);
}

/* Coefficients of the plan, (3 + n,), m; until it is made, of the remainder of the last plan. */
static inline hsep_real *hsep_planner_coefficients(hsep_planner *self) { return hsep_at(self, self->c); }

/* delta at sample k of the plan, m; of a bounded one that is not solved yet, at its first hsep_planner_pinned. */
static inline hsep_real hsep_planner_delta(const hsep_planner *self, hsep_int k)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    return hsep_splines_sum(splines, hsep_at_const(self, self->c), HSEP_N_DECIDED + splines->n, k);
}

typedef enum {
    HSEP_PLAN_FAILED = 0, /* no finite plan: the remainder of the last one is followed */
    HSEP_PLAN_DONE,
    HSEP_PLAN_BOUNDED /* hsep_planner_advance is to be called until it returns another one */
} hsep_plan_status;

/* Knots that a change of the last plan is solved for: of the splines that a bounded plan does not leave as they are. */
HSEP_API hsep_knots hsep_planner_knots(const hsep_predictor_parameters *parameters);

HSEP_API hsep_real hsep_planner_lay_out(hsep_planner *self, const hsep_predictor_parameters *parameters);
/* Fill the block, which is 0, for a drive at rest at start, m. */
HSEP_API void hsep_planner_init(hsep_planner *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* Samples that a bounded plan leaves as they are: the time to solve it in. */
static inline hsep_int hsep_planner_pinned(const hsep_planner *self)
{
    return self->n_pinned * hsep_planner_splines(self)->spacing;
}

/* Begin a plan, a change of the last one's remainder. x_d: commanded positions, m, (horizon,); turns: first samples in
 * which it may turn where no_reversal forbids it; change: share of change_max that bounds it. The cost is
 * 1/2 x' P x - v' x of a change by the splines of the planner's knots. The caller sets the triangle P of m rows and v,
 * (m,); hsep_planner_complete adds the jerk's, times a weight, to v, and to P with what makes it positive definite. */
HSEP_API void hsep_planner_open(hsep_planner *self, const hsep_real x_d[], hsep_int turns, hsep_real change);
static inline hsep_real *hsep_planner_quadratic(hsep_planner *self) { return hsep_at(self, self->P); }
HSEP_API hsep_real *hsep_planner_linear(hsep_planner *self);
HSEP_API void hsep_planner_complete(hsep_planner *self, hsep_real jerk_weight);

/* Or set the cost of the tracking error of a linear model, and of the jerk, for a change by all splines. filtered: the
 * spline after it, (horizon,); target: x_d minus its response to x_d under the remainder, (horizon,) m. */
HSEP_API void hsep_planner_aim(
    hsep_planner *self, const hsep_real filtered[], const hsep_real target[], hsep_real jerk_weight);

/* Open a change of the last plan that ends compensation, with the cost of delta itself, and of its jerk, which makes it
 * as smooth as a short part of a plan allows. It ends where the last plan does. x_d: as hsep_planner_open has it. */
HSEP_API void hsep_planner_end(hsep_planner *self, const hsep_real x_d[]);

/* Plan at this cost, which is used up. A plan at the limits leaves its first samples (hsep_planner_pinned) as they are,
 * and is solved within the tolerance. */
HSEP_API hsep_plan_status hsep_planner_solve(hsep_planner *self, hsep_int steps);

/* Do half a step of a bounded plan. */
HSEP_API hsep_plan_status hsep_planner_advance(hsep_planner *self);

/* Cost of the jerk of a plan, m2, work: (horizon,). */
HSEP_API hsep_real hsep_planner_jerk(const hsep_planner *self, const hsep_real c[], hsep_real work[]);

/* Shorten the plan, once it is made, to what keeps the limits whatever follows the known part of x_d, (preview,), m. */
HSEP_API void hsep_planner_carry_out(hsep_planner *self, const hsep_real x_d[]);

/* Move on by a window with the commanded positions x_d, (Np,), m. */
HSEP_API void hsep_planner_next(hsep_planner *self, const hsep_real x_d[]);

#endif

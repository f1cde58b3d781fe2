/* Planner on the residual model with averaging, by Newton steps that follow the slope of its disturbances.
 *
 * min |x_d - x_h(x_d + delta)|^2 + jerk_weight |D^3 delta|^2 within the drive's limits, where x_h is not affine in
 * delta. Each of one to three Gauss-Newton steps solves the quadratic programme of the model linearised at the best
 * plan so far, friction over what the step before changed, and goes to its minimum if that lowers the cost. Once it has
 * learned, the averaged model judges all plans: its own, the physics model's, and the remainder of the last one. The
 * best is taken; by its own plan only a share of the change is made. Where compensation is off a plan ends it.
 *
 * A plan is one function in reading order, cut by yields into short parts, each of which counts as a few; the longest
 * plan is counted, and hsep_newton_run does a sample's equal share of it.
 */
#ifndef HSEP_NEWTON_H
#define HSEP_NEWTON_H

#include "hsep_physics.h"
#include "hsep_planner.h"
#include "hsep_predictor.h"
#include "hsep_averaged_model.h"

#define HSEP_NEWTON_TRIES 2  /* lengths of a Newton step that are tried */
#define HSEP_NEWTON_VARIED 4 /* variances that are computed in a part */

typedef struct {
    hsep_int horizon, Np;
    hsep_int late;               /* samples before the window that are not measured yet: they are predicted, too */
    hsep_int n, m;               /* splines of a plan, and those that it is solved for */
    hsep_int place;              /* yield after which the plan goes on; 0: at its beginning */
    hsep_int is_physics;         /* whether no better model than the physics model is allowed */
    hsep_int judges;             /* whether the averaged model judges plans, */
    hsep_int may_plan;           /* and whether it may plan */
    hsep_int ends;               /* whether a plan that ends compensation is made */
    hsep_int n_steps;            /* Newton steps of a plan, */
    hsep_int steps;              /* those done, */
    hsep_int gains;              /* whether the last one lowered the cost, */
    hsep_int tries;              /* and lengths of it that were tried */
    hsep_real reach;             /* of friction's slope in it, relative to the velocity scale, */
    hsep_real wider;             /* and in the next one where no length of it lowers the cost */
    hsep_int samples;            /* samples that are predicted, */
    hsep_int spline;             /* splines whose change of x_h, or row of the programme, is computed */
    hsep_int halves;             /* halves of the solver's steps that are left of a programme */
    hsep_int status;             /* hsep_plan_status of the programme that is being solved */
    hsep_int planned;            /* whether a plan is to be made; then its model: 0 none, 1 physics, 2 averaged */
    hsep_real cost;              /* m2, of the best plan so far, */
    hsep_real cost_of_remainder; /* and of the remainder of the last plan */
    hsep_real doubt;             /* m2, variance under the last plan's, weighted as errors */
    hsep_real bound;             /* share of change_max that bounds the averaged model's plan */
    hsep_real share;             /* of its change of the last plan that was taken last, but for what it doubts */
    hsep_int next;               /* what the next part counts as, */
    hsep_int left;               /* and at most it and all after it, nearly always */
    hsep_int remainder;          /* (3 + n,) m, coefficients of the remainder of the last plan */
    hsep_int best;               /* (3 + n,) m, coefficients of the best plan so far */
    hsep_int of_physics;         /* (3 + n,) m, coefficients of the physics model's plan */
    hsep_int command;            /* (horizon + late,) m, commands predicted last, relative to the start, newest first */
    hsep_int x_pb;               /* (horizon + late,) m, their prediction by the physics model, */
    hsep_int e_h;       /* (horizon + late + p,) m, and what the averaged model adds; after it the last residuals */
    hsep_int target;    /* (horizon,) m, work */
    hsep_int weight;    /* (horizon,) of the errors of a plan: they count less at its end */
    hsep_int corrected; /* (n,) m, what the averaged model's last plan changed the one before by; 0 of any other */
    hsep_int begins;    /* (m,) hsep_int, samples that the splines begin with, which are solved for */
    hsep_int shapes;    /* (HSEP_KNOTS_LEVELS, horizon) splines of each distance of knots, */
    hsep_int passed;    /* (HSEP_KNOTS_LEVELS, horizon) and these after G_pb */
    hsep_int gram;      /* triangle of m rows, W' W with G_pb only */
    hsep_int W;         /* (m, horizon) weighted changes of x_h by splines, 0 before they begin */
    hsep_int linearised;
    hsep_int physics; /* G_pb at the beginning of the window, */
    hsep_int trial;   /* and for a trial */
} hsep_newton;
HSEP_ASSERT_WORDS(hsep_newton, 45);

/* What it plans with: other blocks, and the window's data. */
typedef struct {
    hsep_predictor *predictor;
    hsep_averaged *model; /* of the predictor */
    hsep_planner *planner;
    const hsep_real *x_d;  /* (horizon,) m, commanded positions, */
    const hsep_real *load; /* (horizon,) m, and what the drive's load adds to them */
} hsep_newton_task;

HSEP_API hsep_real hsep_newton_lay_out(hsep_newton *self, const hsep_predictor_parameters *parameters);

/* Fill the block, which is 0, with the planner that solves its plans, and a spline after G_pb, (horizon,), m/m. */
HSEP_API void hsep_newton_init(
    hsep_newton *self, const hsep_predictor_parameters *parameters, hsep_planner *plans, const hsep_real spline[]);

/* Begin a window: predict it under the remainder of the last plan, but only samples that the plan leaves as they are,
 * and late ones. allowed: the best model that may plan: 0 none, 1 physics, 2 averaged; before: the last plan's. */
HSEP_API void hsep_newton_begin(hsep_newton *self, const hsep_newton_task *task, hsep_int allowed, hsep_int before);

/* Do parts of the plan: this sample's equal share of what is left, samples being left until the plan is due; all of it
 * in the last one, in which the plan is made and the window predicted. */
HSEP_API void hsep_newton_run(hsep_newton *self, const hsep_newton_task *task, hsep_int samples);

#endif

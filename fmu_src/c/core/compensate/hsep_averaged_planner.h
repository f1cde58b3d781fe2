/* Planner on the residual model with averaging, by Newton steps that follow the slope of its disturbances.
 *
 * min |x_d - x_h(x_d + delta)|^2 + jerk_weight |D^3 delta|^2 within the drive's limits, where x_h is not affine in
 * delta. Each step solves the quadratic programme of the linearised model (Gauss-Newton), and goes towards its
 * minimum as far as lowers the cost. Once it has learned, the averaged model judges all plans: its own, the physics
 * model's, and the remainder of the last one; the best is taken. Where its own asks for a larger change than
 * compensation is made for, it is wrong, and plans none for a time, which doubles.
 *
 * The work is cut into short parts: hsep_averaged_planner_advance does the next part, hsep_averaged_planner_next tells
 * its work, hsep_averaged_planner_left the most that all parts left may take. Both are counted in multiply-adds from
 * the sizes, so that samples can share the work equally. A block as hsep_layout.h has them.
 */
#ifndef HSEP_AVERAGED_PLANNER_H
#define HSEP_AVERAGED_PLANNER_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_linearised.h"
#include "hsep_physics.h"
#include "hsep_planner.h"
#include "hsep_real.h"
#include "hsep_averaged_model.h"

#define HSEP_AVERAGED_STEPS 3    /* Newton steps of a plan at most, */
#define HSEP_AVERAGED_TRIES 2    /* lengths of a step that are tried, */
#define HSEP_AVERAGED_VARIED 4   /* variances that are computed in a part, */
#define HSEP_AVERAGED_PRODUCTS 8 /* rows of a programme that are */
#define HSEP_AVERAGED_AT_FIRST 8 /* the first part of a prediction has one of so many samples, and the commands */

typedef enum {
    HSEP_AVERAGED_DONE = 0,
    HSEP_AVERAGED_VARY,     /* the remainder of the last plan is to be predicted, with variances */
    HSEP_AVERAGED_CHANGE,   /* what its linearisations have in common is to be computed */
    HSEP_AVERAGED_BEGIN,    /* the physics model's plan begins, */
    HSEP_AVERAGED_AIM,      /* its programme is to be made, */
    HSEP_AVERAGED_AIMED,    /* it is to be factored, */
    HSEP_AVERAGED_FACTORED, /* it is to be solved, */
    HSEP_AVERAGED_PHYSICS,  /* it is bounded and being solved */
    HSEP_AVERAGED_STEP,     /* a Newton step begins: slopes of the disturbances are to be computed, */
    HSEP_AVERAGED_AT,       /* the model is to be linearised with them, */
    HSEP_AVERAGED_COLUMN,   /* changes of x_h by the splines are to be computed, */
    HSEP_AVERAGED_PRODUCT,  /* and their products */
    HSEP_AVERAGED_FACTOR,   /* its programme is to be factored, if it does not follow a bounded one, */
    HSEP_AVERAGED_SOLVE,    /* it is to be solved, */
    HSEP_AVERAGED_BOUNDED,  /* it is bounded and being solved */
    HSEP_AVERAGED_JUDGE,    /* a length of the step is to be judged */
    HSEP_AVERAGED_COMPARE,  /* the physics model's plan is to be judged */
    HSEP_AVERAGED_PREDICT   /* the window is to be predicted under the plan */
} hsep_averaged_stage;

typedef struct {
    hsep_int preview, p, Np;
    hsep_int late;        /* samples before the window that are not measured yet: they are predicted, too */
    hsep_int n, n_pinned; /* splines of a plan, and the first ones, which stay as they were */
    hsep_int stage;       /* hsep_averaged_stage */
    hsep_int judges;      /* whether the averaged model judges plans, */
    hsep_int follows;     /* and whether it may plan */
    hsep_int steps;       /* Newton steps begun */
    hsep_int varied;      /* samples that are predicted under the remainder of the last plan, with their variances */
    hsep_int predicted;   /* samples of the plan at hand that are predicted; 0: none is at hand */
    hsep_int columns;     /* splines that are pinned, or whose change of x_h is computed, */
    hsep_int part;        /* parts of the next ones that are, */
    hsep_int rows;        /* or whose row of the programme is */
    hsep_int tries;       /* lengths of this step that were tried */
    hsep_int planned;     /* model of the plan: 0 none, 1 physics, 2 averaged */
    hsep_int bounded;     /* whether the limits bound the programme of the last Newton step */
    hsep_int paused;      /* windows that the averaged model does not plan, now */
    hsep_int pause;       /* and after the next of its plans that runs away */
    hsep_real cost;       /* m2, of the best plan so far, */
    hsep_real unchanged;  /* and of the remainder of the last one */
    hsep_real start;      /* m, position of rest */
    /* Offsets in words from the beginning of the struct */
    hsep_int rest;       /* (3 + n,) m, coefficients of the remainder of the last plan */
    hsep_int best;       /* (3 + n,) m, coefficients of the best plan so far */
    hsep_int of_physics; /* (3 + n,) m, coefficients of the physics model's plan */
    hsep_int command;    /* (preview + late,) m, commands predicted last, relative to the start, newest first */
    hsep_int x_pb;       /* (preview + late,) m, their prediction by the physics model, */
    hsep_int e_h;        /* (preview + late + p,) m, and what the averaged model adds; behind it the last residuals */
    hsep_int target;     /* (preview,) m, work */
    hsep_int W;          /* changes of x_h by the splines that are not pinned: of spline j from sample j spacing on,
                          * behind each other */
    hsep_int linearised;
    hsep_int physics; /* G_pb at the beginning of the window, */
    hsep_int trial;   /* and for a trial */
} hsep_averaged_planner;

HSEP_ASSERT_WORDS(hsep_averaged_planner, 34);

/* What it plans with: other blocks, and the window's data. */
typedef struct {
    hsep_averaged *model;
    hsep_planner *planner;
    const hsep_real *spline; /* (preview,) m/m, a spline filtered by the physics model */
    const hsep_real *x_d;    /* (preview,) m, commanded positions */
} hsep_averaged_task;

/* Bytes of the block, counted as a number so that no size can overflow. */
HSEP_API hsep_real
hsep_averaged_planner_size(const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner);

/* Fill the block for a drive at rest at start, m. */
HSEP_API void hsep_averaged_planner_init(
    hsep_averaged_planner *self, const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner,
    hsep_real start);

/* State before a window. */
typedef struct {
    const hsep_physics *physics; /* G_pb at its beginning */
    const hsep_real *late_command,
        *late_x;                /* (late,) m, command and x_pb of the samples not measured yet, newest first */
    const hsep_real *residuals; /* (p,) m, the last ones measured, newest first */
} hsep_averaged_before;

/* Begin a window: predict it under the remainder of the last plan. best: best model allowed, 0 none, 1 physics, 2
 * averaged. warm: whether the warm-up is over, so that the averaged model judges plans. It predicts only the samples
 * that the plan leaves as they are, and the late ones before them. Cost: as hsep_averaged_forecast; a late
 * measurement adds late^2 / 2 multiply-adds for each expert, here and in the last part, for variances. */
HSEP_API void hsep_averaged_planner_begin(
    hsep_averaged_planner *self, const hsep_averaged_task *task, const hsep_averaged_before *before, hsep_int best,
    int warm);

/* Multiply-adds of the next part; 0: the plan is made and predicted. */
HSEP_API hsep_real hsep_averaged_planner_next(const hsep_averaged_planner *self, const hsep_averaged_task *task);

/* Multiply-adds that the next part and all after it take at most. */
HSEP_API hsep_real hsep_averaged_planner_left(const hsep_averaged_planner *self, const hsep_averaged_task *task);

/* Do the next part. */
HSEP_API void hsep_averaged_planner_advance(hsep_averaged_planner *self, const hsep_averaged_task *task);

#endif

/* Planner on the residual model with trust, by Newton steps that follow the slope of its disturbances.
 *
 * min |x_d - x_h(x_d + delta)|^2 + jerk_weight |D^3 delta|^2 within the drive's limits, where x_h is not affine in
 * delta. Each step solves the quadratic programme of the linearised model (Gauss-Newton), and goes towards its
 * minimum as far as lowers the cost. The plan is compared with the physics model's plan, and the better one is
 * taken. Where a plan asks for a larger change than compensation is made for, the trusted model is wrong, and the
 * physics model plans the rest of the run.
 *
 * The work is cut into short parts: hsep_trusted_planner_advance does the next part, hsep_trusted_planner_next tells
 * its work, hsep_trusted_planner_left the most that all parts left may take. Both are counted in multiply-adds from
 * the sizes, so that samples can share the work equally. A block as hsep_layout.h has them.
 */
#ifndef HSEP_TRUSTED_PLANNER_H
#define HSEP_TRUSTED_PLANNER_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_linearised.h"
#include "hsep_physics.h"
#include "hsep_planner.h"
#include "hsep_real.h"
#include "hsep_averaged_model.h"

#define HSEP_TRUSTED_STEPS 3    /* Newton steps of a plan at most, */
#define HSEP_TRUSTED_TRIES 2    /* lengths of a step that are tried, */
#define HSEP_TRUSTED_VARIED 4   /* variances that are computed in a part, */
#define HSEP_TRUSTED_PRODUCTS 8 /* rows of a programme that are */
#define HSEP_TRUSTED_AT_FIRST 8 /* the first part of a prediction has one of so many samples, and the commands */

typedef enum {
    HSEP_TRUSTED_DONE = 0,
    HSEP_TRUSTED_VARY,     /* the remainder of the last plan is to be predicted, with variances */
    HSEP_TRUSTED_CHANGE,   /* what its linearisations have in common is to be computed */
    HSEP_TRUSTED_BEGIN,    /* the physics model's plan begins, */
    HSEP_TRUSTED_AIM,      /* its programme is to be made, */
    HSEP_TRUSTED_AIMED,    /* it is to be factored, */
    HSEP_TRUSTED_FACTORED, /* it is to be solved, */
    HSEP_TRUSTED_PHYSICS,  /* it is bounded and being solved */
    HSEP_TRUSTED_STEP,     /* a Newton step begins: slopes of the disturbances are to be computed, */
    HSEP_TRUSTED_AT,       /* the model is to be linearised with them, */
    HSEP_TRUSTED_COLUMN,   /* changes of x_h by the splines are to be computed, */
    HSEP_TRUSTED_PRODUCT,  /* and their products */
    HSEP_TRUSTED_FACTOR,   /* its programme is to be factored, if it does not follow a bounded one, */
    HSEP_TRUSTED_SOLVE,    /* it is to be solved, */
    HSEP_TRUSTED_BOUNDED,  /* it is bounded and being solved */
    HSEP_TRUSTED_JUDGE,    /* a length of the step is to be judged */
    HSEP_TRUSTED_COMPARE,  /* the physics model's plan is to be judged */
    HSEP_TRUSTED_PREDICT   /* the window is to be predicted under the plan */
} hsep_trusted_stage;

typedef struct {
    hsep_word preview, p, Np;
    hsep_word late;        /* samples before the window that are not measured yet: they are predicted, too */
    hsep_word n, n_pinned; /* splines of a plan, and the first ones, which stay as they were */
    hsep_word stage;       /* hsep_trusted_stage */
    hsep_word follows;     /* whether the trusted model may plan */
    hsep_word steps;       /* Newton steps begun */
    hsep_word varied;      /* samples that are predicted under the remainder of the last plan, with their variances */
    hsep_word predicted;   /* samples of the plan at hand that are predicted; 0: none is at hand */
    hsep_word columns;     /* splines that are pinned, or whose change of x_h is computed, */
    hsep_word part;        /* parts of the next ones that are, */
    hsep_word rows;        /* or whose row of the programme is */
    hsep_word tries;       /* lengths of this step that were tried */
    hsep_word planned;     /* model of the plan: 0 none, 1 physics, 2 trusted */
    hsep_word bounded;     /* whether the limits bound the programme of the last Newton step */
    hsep_word ended;       /* whether the trusted model plans no more in this run */
    hsep_real cost;        /* m2, of the best plan so far */
    hsep_real start;       /* m, position of rest */
    /* Offsets in words from the beginning of the struct */
    hsep_word rest;       /* (3 + n,) m, coefficients of the remainder of the last plan */
    hsep_word best;       /* (3 + n,) m, coefficients of the best plan so far */
    hsep_word of_physics; /* (3 + n,) m, coefficients of the physics model's plan */
    hsep_word command;    /* (preview + late,) m, commands predicted last, relative to the start, newest first */
    hsep_word x_pb;       /* (preview + late,) m, their prediction by the physics model, */
    hsep_word e_h;        /* (preview + late + p,) m, and what the trusted model adds; behind it the last residuals */
    hsep_word target;     /* (preview,) m, work */
    hsep_word W;          /* changes of x_h by the splines that are not pinned: of spline j from sample j spacing on,
                          * behind each other */
    hsep_word linearised;
    hsep_word physics; /* G_pb at the beginning of the window, */
    hsep_word trial;   /* and for a trial */
} hsep_trusted_planner;

HSEP_ASSERT_WORDS(hsep_trusted_planner, 31);

/* What it plans with: other blocks, and the window's data. */
typedef struct {
    hsep_trusted *model;
    hsep_planner *planner;
    const hsep_real *spline; /* (preview,) m/m, a spline filtered by the physics model */
    const hsep_real *x_d;    /* (preview,) m, commanded positions */
} hsep_trusted_task;

/* Bytes of the block, counted as a number so that no size can overflow. */
HSEP_API hsep_real
hsep_trusted_planner_size(const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner);

/* Fill the block for a drive at rest at start, m. */
HSEP_API void hsep_trusted_planner_init(
    hsep_trusted_planner *self, const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner,
    hsep_real start);
HSEP_API int hsep_trusted_planner_valid(
    const void *block, const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner);

/* State before a window. */
typedef struct {
    const hsep_physics *physics; /* G_pb at its beginning */
    const hsep_real *late_command,
        *late_x;                /* (late,) m, command and x_pb of the samples not measured yet, newest first */
    const hsep_real *residuals; /* (p,) m, the last ones measured, newest first */
} hsep_trusted_before;

/* Begin a window: predict it under the remainder of the last plan. best: best model allowed, 0 none, 1 physics, 2
 * trusted. It predicts only the samples that the plan leaves as they are, and the late ones before them.
 * Cost: as hsep_trusted_forecast; a late measurement adds late^2 / 2 multiply-adds for each expert, here and in the
 * last part, for variances. */
HSEP_API void hsep_trusted_planner_begin(
    hsep_trusted_planner *self, const hsep_trusted_task *task, const hsep_trusted_before *before, hsep_word best);

/* Multiply-adds of the next part; 0: the plan is made and predicted. */
HSEP_API hsep_real hsep_trusted_planner_next(const hsep_trusted_planner *self, const hsep_trusted_task *task);

/* Multiply-adds that the next part and all after it take at most. */
HSEP_API hsep_real hsep_trusted_planner_left(const hsep_trusted_planner *self, const hsep_trusted_task *task);

/* Do the next part. */
HSEP_API void hsep_trusted_planner_advance(hsep_trusted_planner *self, const hsep_trusted_task *task);

#endif

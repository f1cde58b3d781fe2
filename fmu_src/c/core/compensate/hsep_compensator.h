/* Servo error pre-compensation, sample by sample: a predictor (hsep_predictor.h) with commands modified by a planner
 * (hsep_planner.h); eqs. (2) to (6).
 *
 * A window is planned in the sample in which it is predicted. A plan that the drive's limits bound is solved over the
 * samples that follow, while the command follows the last plan. With averaging every plan is solved so, over
 * HSEP_PLANNING_PINNED_AVERAGED samples at most (hsep_newton_run).
 *
 * A sample costs what hsep_predictor.h says, and an equal share of a plan where it follows the last one; without
 * averaging more where fewer than 8 do (Np < 16, or spacing does not divide 8), or it all at once.
 *
 * Once the parameters are in range nothing here fails but the prediction of a window, as in hsep_predictor.h.
 */
#ifndef HSEP_COMPENSATOR_H
#define HSEP_COMPENSATOR_H

#include "hsep.h"
#include "hsep_planner.h"
#include "hsep_predictor.h"
#include "hsep_newton.h"

/* Samples in a row above the largest following error that trip, but for missing ones: one or two may be outliers. */
#define HSEP_N_OVER 3

struct hsep_compensator {
    hsep_int compensate;       /* hsep_sep_state, the best model allowed in the window, */
    hsep_int compensate_next;  /* and from the next one on */
    hsep_real change_max_next; /* m, of the command, likewise */
    hsep_int state;            /* hsep_sep_state of the window, */
    hsep_int before;           /* and of the window before, whose plan the first samples follow with averaging */
    hsep_int n_lost;           /* samples without a measurement after which it is lost; 0: never */
    hsep_int n_missing;        /* measurements that were missing one after another, n_lost at most */
    hsep_real error_max;       /* m, largest following error; 0: none */
    hsep_int n_over;           /* samples above it one after another, HSEP_N_OVER at most: it has tripped */
    hsep_int was_reset;        /* last level of the reset */
    hsep_real x_load;          /* m, load that a sample brings, */
    hsep_real first_load;      /* and that of the first sample, from which it counts, as positions do from the start */
    hsep_int x_dm;             /* (Np,) m, the window: modified commands; before it the last ones not measured yet */
    hsep_int loads;            /* (preview,) m, ring of the loads that came last, */
    hsep_int load;             /* (horizon,) m, of the window and of what follows it, as so much more command */
    hsep_int trial_x;   /* (horizon + q,) m, x_pb of a trial, newest first; then the hybrid model's filtered spline */
    hsep_int trial_e;   /* (horizon + p,) m, its residuals */
    hsep_int target;    /* (horizon,) m */
    hsep_int spline_pb; /* (horizon,) m/m, a spline filtered by the physics model */
    hsep_int trial;     /* the physics model of a trial */
    hsep_int planner, predictor;
    hsep_int newton; /* the planner on the residual model with averaging; 0: the paper's */
};
HSEP_ASSERT_WORDS(hsep_compensator, 23);

HSEP_API hsep_predictor_parameters hsep_compensator_derive(const hsep_parameters *parameters);
HSEP_API hsep_real hsep_compensator_lay_out(hsep_compensator *self, const hsep_predictor_parameters *parameters);
/* Fill the block for a drive at rest at start, m. hsep_compensator_begin has to follow. */
HSEP_API void hsep_compensator_block_init(
    hsep_compensator *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* Parts of the block: the predictor, for a warm start between hsep_compensator_block_init and hsep_compensator_begin;
 * the planner, and the one with averaging, if there is one. */
static inline hsep_predictor *hsep_compensator_predictor(hsep_compensator *self)
{
    return hsep_part(self, self->predictor);
}
static inline hsep_planner *hsep_compensator_planner(hsep_compensator *self) { return hsep_part(self, self->planner); }
static inline hsep_newton *hsep_compensator_newton(hsep_compensator *self) { return hsep_part(self, self->newton); }

/* Begin a window: plan it, or begin to. */
HSEP_API void hsep_compensator_begin(hsep_compensator *self);

#endif

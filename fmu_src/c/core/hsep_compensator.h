/* Servo error pre-compensation, sample by sample: the look-ahead buffer between the interpolator and the drive, which
 * modifies the command while it waits; eqs. (2) to (6) and hsep_planner.h.
 *
 * Sample k brings x_d_ahead = r(k) and x_meas = x(k); after it the outputs are those of k + 1, and x_d(k) =
 * r(k - preview). When k + 1 is a multiple of Np, the whole preview of the next window and every measurement before it
 * have arrived: the weights are solved and the window is planned in that sample. A plan that the drive's limits bound
 * is solved over the samples that follow, while the command follows the last plan. Over the first fill (k < preview)
 * the commanded position is the start; what is measured then is not learned.
 *
 * Cost of a sample, with n features and m splines in a plan: that of hsep_regression_fold(n). At the end of a window on
 * top n^2 / 2 + p^2 / 2 + (2 preview + Np) (p + q) + m^3 / 6 + m preview multiply-adds, the last two twice if the
 * hybrid plan fails, and copies of the regression and of the dead time. While a plan is being solved that of
 * hsep_interior_step, three times in each of the 8 samples that follow; where so many are not pinned (Np < 16, or
 * spacing > 8) more often, or HSEP_INTERIOR_STEPS times at once. All of it is bounded by the parameters; m = 1000 is
 * far from real time.
 *
 * Memory is one block: the struct, then what its offsets tell; no pointers, so a copy of the block is the state.
 * Reentrant; allocates nothing. Once the parameters are in range nothing here fails but the prediction of a window:
 * what was learned may diverge, then the outputs are of no use from then on, and divergence says so.
 */
#ifndef HSEP_COMPENSATOR_H
#define HSEP_COMPENSATOR_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_physics.h"
#include "hsep_planner.h"
#include "hsep_recursion.h"
#include "hsep_regression.h"
#include "hsep_schedule.h"
#include "hsep_sensor.h"
#include "hsep_trust.h"

#include <stdint.h>

/* What a window's command was planned with; of a parameter: the best there may be. */
typedef enum { HSEP_SEP_OFF = 0, HSEP_SEP_PHYSICS = 1, HSEP_SEP_HYBRID = 2 } hsep_sep_state;

typedef struct {
    hsep_planner_parameters planner;
    uint64_t p;         /* lags of e_pb, 1 ... Np */
    uint64_t q;         /* lags of x_pb, 0 ... Np - 1 */
    uint64_t dead_time; /* samples */
    uint64_t n_modes;   /* >= 1 */
    double lambda;      /* m2, > 0 */
    double T_s;         /* s, > 0 */
    double v_s;         /* m/s, over which friction changes its sign; 0: no features of the reference */
    double n_init;      /* samples from the beginning in which the physics model plans; whole, >= 0 */
    hsep_hold hold;
    hsep_sep_state best;
    const hsep_mode *modes; /* (n_modes,) */
} hsep_compensator_parameters;

typedef struct {
    uint64_t Np, preview, p, q;
    uint64_t n_scheduled; /* features of the reference */
    uint64_t best;
    double n_init;
    double sign_step;            /* v_s T_s, m */
    double start;                /* position of rest, m */
    double x_d_last;             /* m, the commanded position before the window */
    uint64_t k;                  /* the sample that comes next */
    uint64_t state;              /* hsep_sep_state of the window */
    uint64_t solving;            /* whether its plan is being solved */
    uint64_t predicted;          /* samples of the window that are planned and predicted */
    uint64_t learning;           /* whether the window is learned, if it is measured */
    uint64_t missing;            /* whether a sample of it was not measured */
    uint64_t n_measured;         /* samples since t_init */
    double sum_e, sum_pb, sum_h; /* m2, sums of squared errors over them */
    uint64_t divergence;         /* hsep_divergence of the first window that could not be predicted; stays */
    hsep_trust trust;
    hsep_sensor sensor;
    /* Offsets in doubles from the beginning of the struct */
    uint64_t ahead;  /* (preview,) m, ring of the commands that came last */
    uint64_t x_d;    /* (preview,) m, commands of the window and what follows it */
    uint64_t x_dm;   /* (Np,) m, the window: modified commands, */
    uint64_t x_pb;   /* (Np,) m, physics-based predictions, */
    uint64_t x_h;    /* (Np,) m, predictions of the model that planned it */
    uint64_t e_h;    /* (Np + p,) m, e_pb as the hybrid model predicted it, newest first, behind it the measured ones */
    uint64_t past_x; /* (Np + q,) m, x_pb of this window and of the q samples before it, newest first */
    uint64_t past_e; /* (Np + p,) m, e_pb likewise, as measured */
    uint64_t weights;   /* (2 + q + p + n_scheduled,) w */
    uint64_t signs;     /* (preview + 2 HSEP_SCHEDULE_REACH,) of the reference's velocity */
    uint64_t drive;     /* (preview,) m, what the features of the reference add to the residuals, newest first */
    uint64_t trial_x;   /* (preview + q,) m, x_pb of a trial, newest first */
    uint64_t trial_e;   /* (preview + p,) m, its residuals */
    uint64_t target;    /* (preview,) m */
    uint64_t spline_pb; /* (preview,) m/m, a spline behind the physics model, */
    uint64_t spline_h;  /* (preview,) m/m, and behind the hybrid one */
    uint64_t physics, trial, regression, saved, planner; /* saved: the regression as it was before this window */
} hsep_compensator;

HSEP_ASSERT_WORDS(hsep_compensator, 48);

typedef struct {
    double x_d, x_dm, x_pb, x_h; /* m, now */
    double rms_e, rms_pb, rms_h; /* m, since t_init */
    uint64_t batch;              /* floor(k / Np) */
    hsep_sep_state state;
} hsep_compensator_outputs;

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_compensator_size(const hsep_compensator_parameters *parameters);

/* Fill the block for a drive at rest at start, m. hsep_compensator_begin has to follow. */
HSEP_API void hsep_compensator_init(
    hsep_compensator *self, const hsep_compensator_parameters *parameters, double start);

/* Where the factor is, to start warm by hsep_regression_load between hsep_compensator_init and _begin. */
HSEP_API hsep_regression *hsep_compensator_regression(hsep_compensator *self);

/* Plan the first window. */
HSEP_API void hsep_compensator_begin(hsep_compensator *self);

/* Tell whether a block of bytes, in any alignment and hsep_compensator_size(parameters) long, is one that
 * hsep_compensator_init with these parameters began: its layout is the same and every index lies within it. */
HSEP_API int hsep_compensator_valid(const void *block, const hsep_compensator_parameters *parameters);

/* Take in sample k, both finite, m, and move on to k + 1. */
HSEP_API void hsep_compensator_sample(hsep_compensator *self, double x_d_ahead, double x_meas);

/* Tell the outputs of the sample that comes next. Constant cost. */
HSEP_API void hsep_compensator_read(const hsep_compensator *self, hsep_compensator_outputs *outputs);

#endif

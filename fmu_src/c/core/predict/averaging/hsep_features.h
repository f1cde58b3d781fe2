/* Features of the experts: disturbances filtered by the physics model, and increments of the command; as
 * predict/averaging/features.py, which says why.
 *
 * Static features are without lags. A row is [1 | x_pb and its differences | changes of the command over spans |
 * filtered disturbances | their first differences]. The expert without a physics model, eq. (4) with G_pb = 1, has
 * increments of the command. Positions are relative to the start, signals newest first (hsep_window.h).
 */
#ifndef HSEP_FEATURES_H
#define HSEP_FEATURES_H

#include "hsep_physics.h"
#include "hsep_predict_constants.h"
#include "hsep_window.h"

#define HSEP_DISTURBANCES_OF_COMMAND (HSEP_FEATURES_N_FRICTION + HSEP_FEATURES_N_STOPS)
#define HSEP_DISTURBANCES_STIFFNESS HSEP_DISTURBANCES_OF_COMMAND /* place, after friction and stop operators */
#define HSEP_DISTURBANCES_DAMPING (HSEP_DISTURBANCES_STIFFNESS + 1)
#define HSEP_DISTURBANCES_MAX (HSEP_FEATURES_N_LASTING + HSEP_FEATURES_N_PERIODIC)
#define HSEP_DISTURBANCES_PAST (HSEP_FEATURES_DIFFERENCES + 1) /* predictions that differences need */
#define HSEP_DISTURBANCES_MOST \
    (2 + HSEP_FEATURES_DIFFERENCES + HSEP_FEATURES_N_SPANS + 2 * HSEP_DISTURBANCES_MAX) /* features at most */

/* What was before a sample. */
typedef struct {
    hsep_real x_d;                             /* m, last command */
    hsep_real x_pb[HSEP_DISTURBANCES_PAST];    /* m, last predictions, newest first */
    hsep_real filtered[HSEP_DISTURBANCES_MAX]; /* last filtered disturbances */
    hsep_real stops[HSEP_FEATURES_N_STOPS];    /* m, stop operators */
} hsep_disturbed;

typedef struct {
    hsep_int n_linear;     /* features before the disturbances' */
    hsep_int count;        /* disturbances, at most HSEP_DISTURBANCES_MAX */
    hsep_int n;            /* features */
    hsep_real period;      /* m, of a disturbance that repeats with the position; 0: none */
    hsep_real origin;      /* m, the start: what repeats does not know of it */
    hsep_int of_motion;    /* whether the position's own velocity is damped; else the velocity of x_pb, which
                              * under a compensator turns with every change of the command, far from the motion */
    hsep_real T_s;         /* s */
    hsep_disturbed before; /* the window that comes next */
    hsep_disturbed after;  /* the samples that were tried last */
    hsep_int filter_words; /* words of a filter */
    hsep_int filters;      /* offset of the hsep_physics of each disturbance before the window, then after
                              * the samples that were tried last */
} hsep_disturbances;

HSEP_ASSERT_WORDS(hsep_disturbed, 1 + HSEP_DISTURBANCES_PAST + HSEP_DISTURBANCES_MAX + HSEP_FEATURES_N_STOPS);
HSEP_ASSERT_WORDS(hsep_disturbances, 9 + 2 * sizeof(hsep_disturbed) / sizeof(hsep_real));

/* Disturbances, and features. */
static inline hsep_int hsep_disturbances_count(const hsep_predictor_parameters *parameters)
{
    return parameters->averaging.period > 0.0 ? HSEP_DISTURBANCES_MAX : HSEP_FEATURES_N_LASTING;
}
static inline hsep_int hsep_disturbances_n(const hsep_predictor_parameters *parameters)
{
    const hsep_int n_differences = hsep_min(parameters->settings.q, HSEP_FEATURES_DIFFERENCES);
    return 2 + n_differences + HSEP_FEATURES_N_SPANS + 2 * hsep_disturbances_count(parameters);
}

HSEP_API hsep_real hsep_disturbances_lay_out(hsep_disturbances *self, const hsep_predictor_parameters *parameters);
/* Fill the block, which is 0, at rest at start, m. */
HSEP_API void hsep_disturbances_init(
    hsep_disturbances *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* Begin in motion, which went on as the n samples of the first window begin, (n,) m each. */
HSEP_API void hsep_disturbances_begin_in_motion(
    hsep_disturbances *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_int n, hsep_real velocity_scale);

/* Motion from one sample to the next, m, that the numbers resolve; else 0: plans of an axis at rest are rounded. */
HSEP_API hsep_real hsep_disturbances_resolved(const hsep_disturbances *self, hsep_real step);

/* Largest magnitude of the commanded velocity over the n samples that come next, m/s, 0 below numbers' resolution. */
HSEP_API hsep_real hsep_disturbances_peak_velocity(const hsep_disturbances *self, const hsep_real x_d[], hsep_int n);

/* Fill the rows of the n samples that come next, (n, self->n), sample after sample, but for what
 * hsep_disturbances_motion fills; may be tried again with others. late: of the commands x_d, with those before them, as
 * hsep_command_late; velocity_scale: m/s, 0 before any motion. Cost:
 * HSEP_FEATURES_N_FRICTION tanh and 9 n_modes HSEP_DISTURBANCES_OF_COMMAND multiply-adds a sample. */
HSEP_API void hsep_disturbances_command(
    hsep_disturbances *self, const hsep_real x_d[], const hsep_real late[], const hsep_real x_pb[], hsep_int n,
    hsep_real velocity_scale, hsep_real rows[]);

/* Fill stiffness, damping and what repeats of samples first ... last - 1 of these in the rows, which act at the
 * position x, (n,), m; first is 0, or where the last call ended; may be tried again. */
HSEP_API void hsep_disturbances_motion(
    hsep_disturbances *self, const hsep_real x_pb[], const hsep_real x[], hsep_int n, hsep_int first, hsep_int last,
    hsep_real rows[]);

/* How far the command of a row goes against the motion before the window, 0 ... 1: the sharpest friction is the
 * direction now, the shortest stop operator that of the last motion. */
HSEP_API hsep_real hsep_disturbances_turned(const hsep_disturbances *self, const hsep_real row[]);

/* End the window, which are the samples that were tried last. */
HSEP_API void hsep_disturbances_end(hsep_disturbances *self);

/* Velocity of the change of sign of friction i, m/s, or distance of a stop operator, m, which are after friction;
 * velocity of the damping at place j of n samples, m/s; angle within the period at a position, rad, 0 without one. */
HSEP_API hsep_real hsep_disturbances_spread(hsep_real velocity_scale, hsep_int i);
HSEP_API hsep_real hsep_disturbances_damped_velocity(
    const hsep_disturbances *self, const hsep_real x_pb[], const hsep_real x[], hsep_int n, hsep_int j);
static inline hsep_real hsep_disturbances_angle(const hsep_disturbances *self, hsep_real x)
{
    return self->period > 0.0 ? HSEP_TWO_PI / self->period * (self->origin + x) : 0.0;
}

/* Features of the command without lags: 1, and the increments. */
#define HSEP_COMMAND_FEATURES (HSEP_AVERAGING_LAGS_OF_COMMAND + 2)

/* Increments of the command. */
typedef struct {
    hsep_int n;         /* samples of a prediction */
    hsep_int dead_time; /* samples before the command may act: at most half of the physics model's, rounded up */
    hsep_int n_before;  /* commands before a window that its features need */
    hsep_int commands;  /* (n + n_before,) m, of a prediction, newest first, and before it: its last m places if it has
                        * fewer samples */
    hsep_int rows;      /* (n, HSEP_COMMAND_FEATURES), sample after sample */
} hsep_command;
HSEP_ASSERT_WORDS(hsep_command, 5);

/* It is all that a block of 0 needs to be at rest. */
HSEP_API hsep_real hsep_command_lay_out(hsep_command *self, const hsep_predictor_parameters *parameters);

/* Take in the commands of the m samples that come next, (m,), m, m <= n; may be tried again with others. */
static inline void hsep_command_take(hsep_command *self, const hsep_real x_d[], hsep_int m)
{
    hsep_copy(hsep_at(self, self->commands) + (self->n - m), x_d, m);
}

/* Fill the rows of samples first ... last - 1 of these. */
HSEP_API void hsep_command_fill(hsep_command *self, hsep_int m, hsep_int first, hsep_int last);

/* Of these, the commands dead_time samples ago, (m,), m. */
static inline const hsep_real *hsep_command_late(const hsep_command *self, hsep_int m)
{
    return hsep_at_const(self, self->commands) + (self->n - m) + self->dead_time;
}

/* End the window, which are the m samples taken in last. */
HSEP_API void hsep_command_end(hsep_command *self, hsep_int m);

/* Begin in motion: commands, m, went on as the first and the second of the first window. */
HSEP_API void hsep_command_begin_in_motion(hsep_command *self, hsep_real first, hsep_real second);

#endif

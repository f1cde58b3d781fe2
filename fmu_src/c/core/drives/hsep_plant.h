/* Nonlinear feed drives, eq. (13), and a stage with friction and cable stiffness; and their position sensor.
 *
 * The command is held over a step; states are relative to the initial position. Classical Runge-Kutta of order 4 in
 * internal steps of at most 0.1 ms and 1/16 of the linear part's fastest time constant; the command is never
 * differentiated. Cost of a step: 4 slopes for each internal step. Plain data; reentrant; allocates nothing.
 */
#ifndef HSEP_PLANT_H
#define HSEP_PLANT_H

#include "hsep_clock.h"
#include "hsep_physics.h"

#define HSEP_PLANT_RATE_MAX 1e5 /* 1/s, of a drive's linear part */

/* Longest step, s, of a drive whose fastest rate is that, 1/s: 10^6 internal steps, which bounds its cost. */
HSEP_API double hsep_plant_step_max(double rate);

/* The fastest rate of a mode, 1/s. */
HSEP_API double hsep_plant_mode_rate(const hsep_mode *mode);

/* m x'' + c x' + k x + H_NL = c x_d' + k x_d with H_NL = c_nl x'|x'| + k_nl x|x|, eq. (13), in the states x and
 * u = x' - (c/m) x_d. The caller sets parameters and start; the drive rests where the others are 0. */
typedef struct {
    double m, c, k;    /* kg, N.s/m, N/m, > 0 */
    double c_nl, k_nl; /* N.s2/m2, N/m2, >= 0 */
    double start;      /* position of rest, m */
    double x, u, x_d;  /* m, m/s, and the last command, m, from there */
} hsep_feed_drive;

/* Advance by h, s, at most hsep_plant_step_max, with the command x_d, m, held. Fails, and returns 0 with the state
 * unchanged, if the state overflows; *x then tells the position reached, m. */
HSEP_API int hsep_feed_drive_step(hsep_feed_drive *self, double x_d, double h, double *x);

HSEP_API double hsep_feed_drive_rate(const hsep_feed_drive *self); /* of the linear part, 1/s */
HSEP_API double hsep_feed_drive_x(const hsep_feed_drive *self);    /* true position, m */
HSEP_API double hsep_feed_drive_v(const hsep_feed_drive *self); /* true velocity under the last step's command, m/s */

/* One mode of the stage: z'' + two_zeta_omega z' + omega2 z = command, eq. (15). */
typedef struct {
    double omega2, two_zeta_omega; /* 1/s^2, 1/s */
    double alpha, beta;            /* 1/s^2, 1/s */
} hsep_stage_mode;

/* Velocity of the stage's friction: the commanded one, the backward difference of x_d over T_s, or the actual one. */
typedef enum { HSEP_FRICTION_COMMAND = 0, HSEP_FRICTION_MOTION = 1 } hsep_friction_on;

/* What a stage is besides its modes. */
typedef struct {
    double f, kappa;      /* m, 1/m */
    double v_friction;    /* m/s, > 0, over which the friction changes sign */
    uint64_t friction_on; /* hsep_friction_on */
    uint64_t dead_time;   /* samples */
    uint64_t input_hold;  /* hsep_input_hold */
} hsep_stage_settings;

/* x = G_pb (x_d - d) with d = f tanh(v_f / v_friction) + kappa x|x|; v_f is the velocity of the friction. Without a
 * dead time and held, a command acts at once; else it is sampled at the instants. A first-order hold with a dead time
 * goes from the last command to this one, which takes one sample of the dead time; without a dead time it goes on with
 * the last slope. Laid out as in hsep_layout.h. */
typedef struct {
    hsep_stage_settings settings;
    double friction_gain; /* m/s, velocity that the whole friction takes away at once, f sum beta */
    double start;         /* position of rest, m */
    hsep_clock clock;     /* of the instants at which the command is sampled, from the reset */
    double acting;        /* m from start, command that acts now */
    double last_x_d, v_d; /* m from start, command of the last instant after the dead time; m/s */
    double v;             /* m/s */
    uint64_t n_modes;
    uint64_t n_line, oldest; /* commands on their way through the dead time; place of the oldest */
    uint64_t modes;          /* hsep_stage_mode[n_modes] */
    uint64_t z;              /* (2 n_modes,) z and z' of each, m s^2 and m s */
    uint64_t line;           /* (n_line,) m from start; after it lies the work space of a step */
} hsep_stage;

HSEP_ASSERT_WORDS(hsep_feed_drive, 9);
HSEP_ASSERT_WORDS(hsep_stage_mode, 4);
HSEP_ASSERT_WORDS(hsep_stage_settings, 6);
HSEP_ASSERT_WORDS(hsep_stage, 23);

/* Set what follows from the parameters; return the bytes of the block. */
HSEP_API double hsep_stage_lay_out(hsep_stage *self, uint64_t n_modes, const hsep_stage_settings *settings);

/* Reset the stage to rest at start, m. modes: (n_modes,), settings: neither of them in the block. */
HSEP_API void hsep_stage_init(
    hsep_stage *self, const hsep_mode modes[], uint64_t n_modes, const hsep_stage_settings *settings, double T_s,
    double start);

/* Advance by h, s, at most hsep_plant_step_max, with the command x_d, m, held. Fails, and returns 0 with
 * the state unchanged, if the state overflows. */
HSEP_API int hsep_stage_step(hsep_stage *self, double x_d, double h);

HSEP_API double hsep_stage_rate(const hsep_stage *self); /* of the fastest mode, 1/s */
HSEP_API double hsep_stage_x(const hsep_stage *self);    /* true position, m */
HSEP_API double hsep_stage_v(const hsep_stage *self);    /* true velocity under the last step's command, m/s */

/* Position sensor with Gaussian noise from a portable generator: SplitMix64 (Steele, Lea and Flood 2014) gives two
 * uniform numbers per sample, the Box-Muller transform (1958) one normal number. */
typedef struct {
    double noise_std; /* m, >= 0 */
    uint64_t seed;
    uint64_t n_draws; /* so far, 0 in the beginning */
} hsep_encoder;
HSEP_ASSERT_WORDS(hsep_encoder, 3);

/* Return one measurement of the position x, m. Constant cost; cannot fail. */
HSEP_API double hsep_encoder_measure(hsep_encoder *self, double x);

#endif

/* hsep: prediction and pre-compensation of a feed drive's servo error, for C99 and C++11. README.md says how to use it.
 *
 * A predictor, or a compensator, is a block of memory that the caller provides: aligned for hsep_real, of the size that
 * hsep_*_size returns. It is plain data without pointers: a copy of its bytes is a saved state. Nothing judges bytes
 * that were changed: keep a checksum with what is stored.
 *
 * Contract of all functions. Reentrant: threads may use different blocks at once, one block is used by one thread at a
 * time. Nothing allocates, locks, opens a file, writes a global or calls the system; libm is all that is needed.
 * Arguments are as said at each function: positions are finite and within +- 1000 m or +- 1e6 rad, pointers are not
 * NULL unless said so, and a block has been begun by hsep_*_init. Only hsep_*_size checks parameters: it
 * returns 0 where one is out of its range, and no other function may be called with such parameters.
 *
 *   function                 | bounded cost                                          | what may fail
 *   hsep_defaults            | constant                                              | nothing
 *   hsep_*_size, _refused    | constant                                              | returns 0: refused
 *   hsep_*_init              | the block's size, the modes' exponentials, the weights| tells refused weights
 *   hsep_*_weights           | n^3 / 3 multiply-adds for n features of an expert      | returns more than size
 *   hsep_predictor_sample    | bounded by the parameters: README.md, Footprint       | divergence is set, latched
 *   hsep_compensator_sample  | the same                                              | divergence is set, latched
 *   hsep_compensator_change  | constant; 10 spacing at the next window's end         | returns 0: refused
 *   hsep_compensator_reset   | constant                                              | nothing
 *   hsep_compensator_load    | constant                                              | nothing
 *   hsep_*_read, hsep_predictor_std | constant                                       | nothing
 *
 * The dearest sample costs the same at the first and at the 10^9th sample, but for a first window that begins in
 * motion: its last sample learns the whole window.
 */
#ifndef HSEP_H
#define HSEP_H

#include <stddef.h>
#include "hsep_real.h"

#include "hsep_api.h"
#include "hsep_settings.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One mode of the drive's linear model, eq. (15):
 * (alpha + beta s) / (s^2 + 2 zeta omega s + omega^2) with omega = 2 pi f_n, from command to position. */
typedef struct {
    hsep_real f_n;   /* natural frequency, Hz, > 0 */
    hsep_real zeta;  /* damping ratio, 1, > 0; 1 is critical, more is over-damped */
    hsep_real alpha; /* numerator, 1/s^2 */
    hsep_real beta;  /* numerator, 1/s */
} hsep_mode;

/* How the command runs between samples, of the setting input_hold. */
typedef enum { HSEP_ZERO_ORDER_HOLD = 0, HSEP_FIRST_ORDER_HOLD = 1 } hsep_hold;

/* Settings, each with meaning, unit and range in hsep_settings.h. */
typedef struct {
    hsep_predictor_settings predictor;
    hsep_averaging_settings averaging;
    hsep_compensator_settings compensator; /* of no meaning for a predictor */
    hsep_int n_modes;                      /* >= 1 */
    const hsep_mode *modes;                /* (n_modes,), read while a function runs, not kept */
} hsep_parameters;

/* Fill in every setting's default; modes: none. */
HSEP_API void hsep_defaults(hsep_parameters *parameters);

/* How hsep_*_init began. */
typedef enum {
    HSEP_BEGAN = 0,           /* as asked */
    HSEP_WEIGHTS_DAMAGED = 1, /* cold: the weights are damaged, truncated or of another version */
    HSEP_WEIGHTS_OTHER = 2    /* cold: they were learned with other settings or modes */
} hsep_began;

/* Signal of a window that is out of range (1e100 m, in single precision 1e15 m): the learned recursion diverges. */
typedef enum { HSEP_CONVERGES = 0, HSEP_DIVERGES_X_PB, HSEP_DIVERGES_X_H, HSEP_DIVERGES_X_DM } hsep_divergence;

/* ------------------------------------------------------------------------------------------------ The predictor --
 *
 * It is a look-ahead buffer between interpolator and drive. Sample k brings x_d_ahead, the command r(k) that the drive
 * is to have Np samples later, and x_meas, the position measured now; after it the outputs belong to sample k + 1, with
 * x_d(k) = r(k - Np). Until r(0) arrives at the drive, the drive is at rest at start. Where the measurement is late by
 * measurement_delay samples, x_meas = x(k - measurement_delay); with -1 a sample early, and then held for one sample.
 */
typedef struct hsep_predictor hsep_predictor;

typedef struct {
    hsep_real x_d, x_pb, x_h; /* m, now: command, predictions by the physics model and by the hybrid one */
    hsep_real x_h_std;        /* m, standard deviation of the error of x_h; 0 where it is not known */
    hsep_real rms_e, rms_pb, rms_h, rms_hold; /* m, since t_init: of the servo error and of predictions' errors */
    hsep_int batch;                           /* floor(k / Np) */
    hsep_int n_rejected;                      /* measurements that were missing or not plausible, with averaging */
    int hybrid_active;                        /* whether x_h is the hybrid prediction now */
    hsep_divergence divergence;               /* HSEP_CONVERGES, or the outputs are invalid until hsep_*_init */
} hsep_predictor_outputs;

/* Bytes of the block; 0 if a parameter is out of its range, p > Np, q >= Np, there are no modes, or too many bytes. */
HSEP_API size_t hsep_predictor_size(const hsep_parameters *parameters);

/* Name of the first parameter for which that is 0, "modes" if there are none; NULL: none, or the block is too large. */
HSEP_API const char *hsep_predictor_refused(const hsep_parameters *parameters);

/* Begin with the drive at rest at start, m. weights: content of a file weights.bin, weights_size bytes, as
 * `hybridsep hal --weights` and an FMU's resources have it, or NULL: cold. Weights that are refused change nothing: the
 * block has begun cold. */
HSEP_API hsep_began hsep_predictor_init(
    hsep_predictor *self, const hsep_parameters *parameters, hsep_real start, const void *weights, size_t weights_size);

/* Process sample k, m; return whether a new window has begun. With averaging x_meas may be NaN: it is missing. */
HSEP_API int hsep_predictor_sample(hsep_predictor *self, hsep_real x_d_ahead, hsep_real x_meas);

/* Read the outputs of the next sample. */
HSEP_API void hsep_predictor_read(const hsep_predictor *self, hsep_predictor_outputs *outputs);

/* Write what was learned so far as a file weights.bin into bytes, (size,), aligned for double: hsep_*_init, FMUs and
 * the Python library of this version and later ones begin a run with it. parameters: as of hsep_*_init; in single
 * precision they are rounded, and fit only a library in single precision. Returns the bytes of the file; nothing is
 * written where size is less, or bytes is NULL. No output changes by it. */
HSEP_API size_t
hsep_predictor_weights(hsep_predictor *self, const hsep_parameters *parameters, void *bytes, size_t size);

/* Standard deviation of the error of x_h at sample i of the window, i < Np, m; 0 where it is not known. */
HSEP_API hsep_real hsep_predictor_std(const hsep_predictor *self, hsep_int i);

/* ---------------------------------------------------------------------------------------------- The compensator --
 *
 * A predictor whose commands are modified, x_dm, so that the drive follows x_d within the limits of its settings.
 * Sample k brings x_d_ahead, the command that the drive is to follow preview samples later, and x_meas, as above.
 */
typedef struct hsep_compensator hsep_compensator;

/* Model that plans the commands of a window; tripped: none, until a reset. As a setting: the best model allowed. */
typedef enum { HSEP_SEP_OFF = 0, HSEP_SEP_PHYSICS = 1, HSEP_SEP_HYBRID = 2, HSEP_SEP_TRIPPED = 3 } hsep_sep_state;

typedef struct {
    hsep_predictor_outputs
        predicted;        /* x_h by the model that planned the window; with averaging by the averaged model */
    hsep_real x_dm;       /* m, now */
    hsep_sep_state state; /* of the plan that x_dm follows now */
    int no_measurement;   /* whether the change fades, as none came for measurement_timeout */
    int alarm;            /* whether it has tripped */
} hsep_compensator_outputs;

/* Bytes of the block; 0 as the predictor's, and if spacing does not divide Np, preview < Np + 4 spacing + 3, or a
 * measurement is late without averaging. */
HSEP_API size_t hsep_compensator_size(const hsep_parameters *parameters);

/* As hsep_predictor_refused. */
HSEP_API const char *hsep_compensator_refused(const hsep_parameters *parameters);

/* Begin, and plan the first window; as hsep_predictor_init. */
HSEP_API hsep_began hsep_compensator_init(
    hsep_compensator *self, const hsep_parameters *parameters, hsep_real start, const void *weights,
    size_t weights_size);

/* As hsep_predictor_weights. */
HSEP_API size_t
hsep_compensator_weights(hsep_compensator *self, const hsep_parameters *parameters, void *bytes, size_t size);

/* Other settings from the next window on; no command jumps. compensate: the best model allowed; change_max, m, > 0;
 * following_error_max, m, which counts from the next sample on, 0: none. Every plan goes on from the remainder of the
 * last plan, which keeps the drive's limits and ends at x_d. With compensate off a plan ends compensation, within them.
 * Where the remainder is larger than change_max, it is the bound. Return whether they were taken: not, with nothing
 * changed, where one is out of its range. */
HSEP_API int hsep_compensator_change(
    hsep_compensator *self, hsep_sep_state compensate, hsep_real change_max, hsep_real following_error_max);

/* End a trip where the level of the reset rises; what was learned before stays. It trips where x_meas is farther from
 * x_d, or in the geometric mean from x_d and x_dm, than following_error_max for three samples in a row: from the next
 * window on the change fades, as with compensate off. With averaging nothing that is measured above it, or until the
 * reset, is learned. */
HSEP_API void hsep_compensator_reset(hsep_compensator *self, int level);

/* Set the load that the samples from now on bring, finite, 0 before: force or torque on the axis divided by the
 * stiffness of its position loop, m, positive where it pushes the axis forwards, as a rigid-body model, gravity or a
 * table tells it; known preview samples ahead, as x_d_ahead is. It is added to the command of the drive's model,
 * counted from that of the first sample, so plans make up for it, within the limits. */
HSEP_API void hsep_compensator_load(hsep_compensator *self, hsep_real x_load);

/* Process sample k, m; return whether a new window has begun. With averaging x_meas may be NaN: it is missing. */
HSEP_API int hsep_compensator_sample(hsep_compensator *self, hsep_real x_d_ahead, hsep_real x_meas);

/* Read the outputs of the next sample. */
HSEP_API void hsep_compensator_read(const hsep_compensator *self, hsep_compensator_outputs *outputs);

#ifdef __cplusplus
}
#endif

#endif

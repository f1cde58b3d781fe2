/* Features without lags: the physics-based prediction, and disturbances filtered by the physics model.
 *
 * What the physics model misses acts where the command does, so e_pb = G_pb d(x, v). A feature is G_pb applied to a
 * candidate disturbance d: friction tanh(v / v_i) over a spread of velocities v_i, stiffness x |x| and damping v |v|.
 * A row is [1 | x_pb and its differences | filtered disturbances | their first differences].
 *
 * Positions are relative to the start. Sample k of the n that are predicted is at place n - 1 - k: newest first, as its
 * past is behind it. The next window begins behind the first Np. Memory is one block, without pointers. Reentrant;
 * allocates nothing.
 */
#ifndef HSEP_DISTURBANCES_H
#define HSEP_DISTURBANCES_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_physics.h"
#include "hsep_settings.h"

#include <stdint.h>

#define HSEP_N_DISTURBANCES 8

typedef struct {
    uint64_t Np, n_ahead;   /* samples of a window, and those that are predicted */
    uint64_t n_differences; /* of x_pb, at most 3 */
    uint64_t n;             /* features */
    double T_s;             /* s */
    /* Before the window that comes next */
    double x_d;                           /* m, last command */
    double x_pb[4];                       /* m, last predictions, newest first */
    double filtered[HSEP_N_DISTURBANCES]; /* last filtered disturbances */
    double tried;                         /* the stiffness at the end of the window, as it was tried last */
    uint64_t filter_words;                /* doubles of a filter */
    uint64_t filters;                     /* offset of the hsep_physics of each disturbance */
    uint64_t trial;                       /* offset of that of the stiffness at the end of the window */
    uint64_t beyond;                      /* offset of one that goes on beyond the window */
} hsep_disturbances;

HSEP_ASSERT_WORDS(hsep_disturbances, 23);

/* Features for the largest lag q. */
HSEP_API uint64_t hsep_disturbances_n(uint64_t q);

/* Effect that a feature may have, relative to the largest. */
HSEP_API double hsep_disturbances_share(const hsep_disturbances *self, uint64_t feature);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_disturbances_size(const hsep_predictor_settings *settings, uint64_t n_modes, uint64_t late);

/* Fill the block, at rest. modes: (n_modes,); late: samples predicted beyond a window. */
HSEP_API void hsep_disturbances_init(
    hsep_disturbances *self, const hsep_predictor_settings *settings, const hsep_mode modes[], uint64_t n_modes,
    uint64_t late);

/* Begin again, with the motion before the window, (n,) m each, as it begins. */
HSEP_API void hsep_disturbances_restart(hsep_disturbances *self, const double x_d[], const double x_pb[]);

/* Whether a block, in any alignment, is one that hsep_disturbances_init with these parameters began. */
HSEP_API int hsep_disturbances_valid(
    const void *block, const hsep_predictor_settings *settings, uint64_t n_modes, uint64_t late);

/* Largest magnitude of the commanded velocity over the samples that come next, m/s. x_d: (n,), m, newest first. */
HSEP_API double hsep_disturbances_peak_velocity(const hsep_disturbances *self, const double x_d[]);

/* Fill the rows, (n_ahead, n), sample after sample, of the samples that come next but for their stiffness, and advance
 * by a window. velocity_scale: m/s, 0 before any motion. Cost: 6 tanh and 9 (7 n_modes) multiply-adds a sample. */
HSEP_API void hsep_disturbances_begin(
    hsep_disturbances *self, const double x_d[], const double x_pb[], double velocity_scale, double rows[]);

/* Fill the stiffness in the rows of its first n samples, which acts at the position x, (n,), m; may be tried again. */
HSEP_API void hsep_disturbances_stiffness(hsep_disturbances *self, const double x[], double rows[], uint64_t n);

/* End the window with the stiffness that was tried last, over the window alone. */
HSEP_API void hsep_disturbances_end(hsep_disturbances *self);

#endif

/* Discrete-time physics-based model G_pb under a zero- or first-order hold, eqs. (2) and (15); as model/discrete.py.
 * Nothing here can fail once the parameters are in range. */
#ifndef HSEP_PHYSICS_H
#define HSEP_PHYSICS_H

#include "hsep_window.h"
#include "hsep_layout.h"

/* A mode between two samples: s(k+1) = A s(k) + b u(k), its part of x_pb(k) is c s(k) + d u(k); s in m. */
typedef struct {
    hsep_real A[4]; /* (2, 2) by rows, 1 */
    hsep_real b[2]; /* (2,), 1 */
    hsep_real c[2]; /* (2,), 1 */
    hsep_real d;    /* 1; 0 for a zero-order hold */
    hsep_real s[2]; /* (2,), m, the state */
} hsep_discrete_mode;

typedef struct {
    hsep_int n_modes;
    hsep_int dead_time; /* whole samples by which the command is delayed */
    hsep_int oldest;    /* index of the next command to leave the dead time's ring */
    hsep_int modes;     /* hsep_discrete_mode[n_modes] */
    hsep_int ring;      /* (dead_time,) m, commands within the dead time */
} hsep_physics;

HSEP_ASSERT_WORDS(hsep_mode, 4);
HSEP_ASSERT_WORDS(hsep_discrete_mode, 11);
HSEP_ASSERT_WORDS(hsep_physics, 5);

/* Fill a mode for the sampling interval T_s, s, at rest. Exact up to rounding in every damping regime.
 * Cost: about 2 000 multiply-adds, and 64 for each doubling of the norm of the mode times T_s. */
HSEP_API void hsep_discretise(hsep_discrete_mode *mode, const hsep_mode *continuous, hsep_real T_s, hsep_hold hold);

HSEP_API hsep_real hsep_physics_lay_out(hsep_physics *self, const hsep_predictor_parameters *parameters);
/* Fill the block, at rest at position 0. */
HSEP_API void hsep_physics_init(hsep_physics *self, const hsep_predictor_parameters *parameters);

/* Begin with a state, (2 n_modes + dead_time,), m: the modes', then the commands within the dead time, oldest first. */
HSEP_API void hsep_physics_begin(hsep_physics *self, const hsep_real state[]);

/* Add the state of another one with the same parameters: it responds to the sum of both commands then. */
HSEP_API void hsep_physics_add(hsep_physics *self, const hsep_physics *other);

/* Response x_pb, m, to the command x_d of the next sample, m, relative to the start; eq. (2). 9 operations a mode. */
HSEP_API hsep_real hsep_physics_respond(hsep_physics *self, hsep_real x_d);

#define HSEP_PHYSICS_ABREAST 4 /* signals side by side at most */

/* Responses x, m, of count models with the same parameters to the signals u, m, both (n, HSEP_PHYSICS_ABREAST), sample
 * after sample: the same numbers as one model after the other, whose every sample waits for the one before. u is
 * delayed by the dead time; after count it is finite. The states are carried from call to call. */
HSEP_API void hsep_physics_abreast(hsep_physics *const models[], size_t count, hsep_real u[], hsep_real x[], size_t n);

#endif

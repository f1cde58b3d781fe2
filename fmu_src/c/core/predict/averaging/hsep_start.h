/* Motion before a run, estimated from its first window; as predict/averaging/start.py, which says how.
 *
 * Positions are relative to the start, signals newest first. A block as hsep_layout.h has them.
 */
#ifndef HSEP_START_H
#define HSEP_START_H

#include "hsep_physics.h"
#include "hsep_window.h"

typedef struct {
    hsep_int Np, n;             /* samples measured and predicted */
    hsep_int n_states;          /* of the modes */
    hsep_int dead_time;         /* samples */
    hsep_int states;            /* offsets in words: (n_states + dead_time,) state of a motion by one metre a sample */
    hsep_int state;             /* (n_states + dead_time,) m, the one that is tried */
    hsep_int response;          /* (n + Np,) m, to it, oldest first */
    hsep_int responses;         /* (n_states, n) to each state of the modes alone, oldest first */
    hsep_int weights;           /* (n_states,) m, change of the state */
    hsep_int trial, regression; /* the physics model on its own; least squares */
} hsep_start;
HSEP_ASSERT_WORDS(hsep_start, 11);

HSEP_API hsep_real hsep_start_lay_out(hsep_start *self, const hsep_predictor_parameters *parameters);
/* Fill the block, which is 0. */
HSEP_API void hsep_start_init(hsep_start *self, const hsep_predictor_parameters *parameters);

/* Whether the commands of the first window, (n,), m, begin in motion. */
HSEP_API int hsep_start_moves(const hsep_start *self, const hsep_real x_d[]);

/* Whether the run began in motion: x_d: (n,), m, commands of its first window; e: (Np,), m, measured residuals of its
 * first samples relative to what was predicted, NaN where missing. Cost: n n_states (9 n_states / 2 + n_states)
 * multiply-adds, once. */
HSEP_API int hsep_start_estimate(hsep_start *self, const hsep_real x_d[], const hsep_real e[]);

/* After that: add the motion to commands and physics-based prediction of the window, (n,), m, to the prediction of the
 * Np samples behind it, oldest first, and to the state of the physics model behind all of these. */
HSEP_API void hsep_start_apply(
    const hsep_start *self, hsep_real x_d[], hsep_real x_pb[], hsep_real ahead[], hsep_physics *physics);

#endif

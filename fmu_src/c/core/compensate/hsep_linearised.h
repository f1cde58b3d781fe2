/* Linearisation of the residual model with averaging (online model averaging) in the commands, over a preview.
 *
 * Disturbances are not affine in the commands, so a plan uses their slope at given commands, which is sech^2(v / v_i)
 * for friction, and 2 |x| for stiffness. Stop operators, the weights of the experts and of the stack, and the shrinking
 * by the variance, are held constant:
 *
 *   dx_h = (1 - pi_A) G_pb + pi_L df_L + pi_S df_S + pi_A dx_A
 *
 * The expert of the command alone, A, is linear and time-invariant: its features are increments and lags of the
 * command. The expert D, which doubts earlier runs, counts as the expert whose counterpart it is.
 */
#ifndef HSEP_LINEARISED_H
#define HSEP_LINEARISED_H

#include "hsep_averaged_model.h"

typedef struct {
    hsep_int n;       /* samples of a prediction, */
    hsep_int preview; /* and its last ones, which a change may reach: all but what is late */
    hsep_int count;   /* disturbances */
    hsep_int moves;   /* samples in which v_d of a change, or of the sample before, is not 0 */
    /* Oldest first; of experts: of all that rows train, one after the other; abreast: HSEP_PHYSICS_ABREAST columns side
     * by side, sample after sample */
    hsep_int slopes;      /* (n, count) slopes of the disturbances, sample after sample */
    hsep_int gains;       /* (5, n) of experts: gains of disturbances and their differences, from v_d now and a sample
                           * before, from x now and in the two samples before */
    hsep_int shrink;      /* (n,) of experts: share of each one in the stack */
    hsep_int commands;    /* (1 + preview,) of a change, with one sample before it, */
    hsep_int velocity;    /* (2 + preview,) v_d of a change, with two samples before it, */
    hsep_int position;    /* (2 + preview,) and it behind G_pb */
    hsep_int base;        /* (preview,) of a change: (1 - pi_A) G_pb + pi_A after the dead time, */
    hsep_int response;    /* (preview + 3,) of experts: the response to it, of x_pb's features or of the command */
    hsep_int run;         /* (preview + 3,) abreast: work of a recursion; alone: newest first */
    hsep_int lags;        /* (p + 3,) weights of the lags, as often as a vector has lanes */
    hsep_int disturbance; /* (preview + 3,) abreast: disturbances that a change makes, */
    hsep_int drive;       /* and these behind G_pb */
    hsep_int physics;     /* G_pb at rest, */
    hsep_int filters;     /* and of each column */
} hsep_linearised;
HSEP_ASSERT_WORDS(hsep_linearised, 18);

HSEP_API hsep_real hsep_linearised_lay_out(hsep_linearised *self, const hsep_predictor_parameters *parameters);
HSEP_API void hsep_linearised_init(hsep_linearised *self, const hsep_predictor_parameters *parameters);

/* A change of the commands that begins at sample 0 of the preview. */
typedef struct {
    hsep_real *commands; /* (n,) m, oldest first, and nothing behind them */
    hsep_int n;
    hsep_real *passed; /* (preview,) m, the same behind G_pb */
} hsep_linearised_change;

/* Begin to linearise a model that has learned, for a change that may begin at any sample of the preview: what does not
 * depend on the commands. Cost: p multiply-adds a sample for each expert of the command. */
HSEP_API void hsep_linearised_begin(hsep_linearised *self, hsep_averaged *model, const hsep_linearised_change *change);

/* Linearise at commands x_d that the model was last tried with, with the response x_pb, both (n,), m, newest first.
 * reach: half of the change of velocity that the friction's slope is taken over, relative to the velocity scale; 0: the
 * tangent. Cost: 12 tanh a sample. */
HSEP_API void hsep_linearised_at(
    hsep_linearised *self, hsep_averaged *model, const hsep_real x_d[], const hsep_real x_pb[], hsep_real reach);

/* Changes of x_h, m, by that change of the commands where it begins at the samples first + c spacing of the preview, c
 * < count <= HSEP_PHYSICS_ABREAST: columns[c] is (preview - first - c spacing,). Cost: HSEP_PHYSICS_ABREAST (9 n_modes
 * + p + 21) multiply-adds a sample for each expert that predicts the residual of the physics model, and counts. */
HSEP_API void hsep_linearised_columns(
    hsep_linearised *self, hsep_averaged *model, hsep_int first, hsep_int spacing, hsep_int count,
    hsep_real *const columns[HSEP_PHYSICS_ABREAST]);

#endif

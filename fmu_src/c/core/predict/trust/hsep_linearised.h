/* Linearisation of the residual model that can be trusted in the commands, over a preview.
 *
 * Disturbances of the commands are no affine functions of them, so a plan follows their slope: at given commands the
 * prediction changes with them as an affine map does, friction by sech^2(v / v_i), stiffness by 2 |x|. Weights,
 * the stack's and the shrinking by the variance are held:
 *
 *   dx_h = (1 - pi_A) G_pb + pi_L df_L + pi_S df_S + pi_A dx_A
 *
 * with the expert of the command alone, A, linear and time-invariant: its increments and lags are those of the command.
 * An expert that doubts earlier runs, D, counts as the one of these whose counterpart it is.
 * Memory is one block, without pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_LINEARISED_H
#define HSEP_LINEARISED_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_trusted.h"

#include <stdint.h>

#define HSEP_LINEARISED_EXPERTS 3 /* of the physics model's residual */

typedef struct {
    uint64_t n;       /* samples of a prediction, */
    uint64_t preview; /* and its last ones, which a change may reach: all but what is late */
    uint64_t count;   /* disturbances */
    /* Offsets in doubles from the beginning of the struct; oldest first, if not said; of experts: those of the physics
     * model's residual, behind each other, of experts abreast: HSEP_PHYSICS_ABREAST numbers a sample */
    uint64_t slopes;      /* (n, count) slopes of the disturbances, sample after sample */
    uint64_t gains;       /* (n, 6) of experts abreast: what friction, position and damping give of changes of v_d, x
                           * and v, the disturbances themselves and then their differences */
    uint64_t shrink;      /* (n,) of experts: part of each one in the stack, */
    uint64_t kept;        /* (2, n) and of those of the command */
    uint64_t change;      /* (preview, 3) of a change: v_d, x and v, the latter two behind G_pb */
    uint64_t base;        /* (preview,) of a change: (1 - pi_A) G_pb + pi_A after the dead time, */
    uint64_t of_command;  /* (2, preview) and what the experts of the command make of it */
    uint64_t passed;      /* (preview,) of experts: what the features of x_pb give of it */
    uint64_t run;         /* (preview,) work of a recursion, newest first */
    uint64_t disturbance; /* (preview,) of experts abreast: disturbances that a change makes, */
    uint64_t drive;       /* and these behind G_pb */
    uint64_t physics;     /* G_pb at rest, */
    uint64_t filters;     /* and of each expert */
} hsep_linearised;

HSEP_ASSERT_WORDS(hsep_linearised, 16);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_linearised_size(const hsep_trusted_parameters *parameters);

/* Fill the block. */
HSEP_API void hsep_linearised_init(hsep_linearised *self, const hsep_trusted_parameters *parameters);

/* Whether a block, in any alignment, is one that hsep_linearised_init with these parameters began. */
HSEP_API int hsep_linearised_valid(const void *block, const hsep_trusted_parameters *parameters);

/* A change of the commands that begins at sample 0 of the preview. */
typedef struct {
    const double *commands; /* (n,) m, oldest first, and nothing behind them */
    uint64_t n;
    const double *passed; /* (preview,) m, the same behind G_pb */
} hsep_linearised_change;

/* Linearise at commands x_d that the model, which has learned, was last tried with, with the response x_pb, both
 * (n,), m, newest first, for a change that may begin at any sample of the preview. reach: see hsep_disturbances_slopes.
 * Cost: 12 tanh a sample. */
HSEP_API void hsep_linearised_at(
    hsep_linearised *self, hsep_trusted *model, const double x_d[], const double x_pb[],
    const hsep_linearised_change *change, double reach);

/* Change of x_h, (preview - first,), m, by that change of the commands where it begins at sample first of the preview.
 * Cost: for each expert of the physics model's residual 8 n_modes + p + 10 multiply-adds a sample. */
HSEP_API void hsep_linearised_column(hsep_linearised *self, hsep_trusted *model, uint64_t first, double column[]);

#endif

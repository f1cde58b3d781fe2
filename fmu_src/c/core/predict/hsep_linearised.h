/* Linearisation of the residual model that can be trusted in the commands, over a preview.
 *
 * Disturbances of the commands are no affine functions of them, so a plan follows their slope: at given commands the
 * prediction changes with them as an affine map does, friction by sech^2(v / v_i), stiffness by 2 |x|. Weights, their
 * blend and the shrinking by the variance are held. Memory is one block, without pointers. Reentrant; allocates
 * nothing.
 */
#ifndef HSEP_LINEARISED_H
#define HSEP_LINEARISED_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_trusted.h"

#include <stdint.h>

typedef struct {
    uint64_t n;     /* samples of the preview */
    uint64_t count; /* disturbances */
    /* Offsets in doubles from the beginning of the struct; signals of each candidate behind each other, oldest first */
    uint64_t slopes;  /* (n, count) slopes of the disturbances, sample after sample */
    uint64_t gains;   /* (HSEP_N_CANDIDATES, 6, n) what friction, position and damping give of changes of v_d, x and v,
                       * the disturbances themselves and then their differences */
    uint64_t shrink;  /* (HSEP_N_CANDIDATES, n) part of each candidate in the blend */
    uint64_t passed;  /* (HSEP_N_CANDIDATES, n) what the features of x_pb give of a change */
    uint64_t run;     /* (n,) work of a recursion, newest first, */
    uint64_t drive;   /* (n,) and that which drives it, oldest first */
    uint64_t physics; /* G_pb at rest, */
    uint64_t filter;  /* and for one change */
} hsep_linearised;

HSEP_ASSERT_WORDS(hsep_linearised, 10);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_linearised_size(const hsep_trusted_parameters *parameters);

/* Fill the block. */
HSEP_API void hsep_linearised_init(hsep_linearised *self, const hsep_trusted_parameters *parameters);

/* Whether a block, in any alignment, is one that hsep_linearised_init with these parameters began. */
HSEP_API int hsep_linearised_valid(const void *block, const hsep_trusted_parameters *parameters);

/* Linearise at commands x_d that the model, which has learned, was last tried with, with the response x_pb, both
 * (preview,), m, newest first. passed: a change of the commands behind G_pb, (preview,), m, which begins at sample 0;
 * reach: see hsep_disturbances_slopes. Cost: 12 tanh a sample. */
HSEP_API void hsep_linearised_at(
    hsep_linearised *self, hsep_trusted *model, const double x_d[], const double x_pb[], const double passed[],
    double reach);

/* Change of x_h, (preview - first,), m, by that change of the commands where it begins at sample first: change, the
 * first n_change samples, m, before G_pb, and passed behind it. Cost: for each candidate 8 n_modes + p + 20
 * multiply-adds a sample. */
HSEP_API void hsep_linearised_column(
    hsep_linearised *self, hsep_trusted *model, const double change[], uint64_t n_change, const double passed[],
    uint64_t first, double column[]);

#endif

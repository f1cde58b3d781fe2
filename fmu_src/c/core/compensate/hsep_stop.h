/* Stops of plans that are longer than the preview.
 *
 * Behind the preview a plan takes the command to go on at its last velocity. What comes may be another command, so each
 * plan has a stop beside it: it shares the splines that are carried out before the next plan, and then brings the
 * change of the command to a constant within the preview, which takes nothing of the limits of what follows. A plan is
 * carried out as far as it has a stop within the limits; otherwise the last stop goes on.
 *
 * A block as hsep_layout.h has them.
 */
#ifndef HSEP_STOP_H
#define HSEP_STOP_H

#include "hsep_layout.h"
#include "hsep_splines.h"

#define HSEP_STOP_WORK 250.0 /* multiply-adds for each sample of the preview to carry out a plan */

typedef struct {
    hsep_int preview; /* samples of the command that are known */
    hsep_int shared;  /* splines that a stop has from its plan, */
    hsep_int n;       /* and those before all coefficients are alike */
    hsep_int count;   /* coefficients: the decided ones and those of all splines that begin in the preview */
    hsep_real pole;   /* of a change that fades, from spline to spline */
    /* Offsets in words from the beginning of the struct */
    hsep_int last;  /* (count,) m, the last stop, */
    hsep_int own;   /* (count,) m, by which it differs from one that stops as these do, */
    hsep_int now;   /* (count,) m, and the stop of the plan */
    hsep_int gains; /* (2 (n - shared),) of the first two differences of coefficients, which make the next one */
    /* (4 preview,) in shares */
    hsep_int low, high;            /* bounds of the rows of a change, */
    hsep_int start, way, own_rows; /* the last stop without its own part, the way to the plan's, and that part */
} hsep_stop;

HSEP_ASSERT_WORDS(hsep_stop, 14);

/* shared: splines of a window, and those that the next plan leaves as they are. */
HSEP_API hsep_real hsep_stop_lay_out(hsep_stop *self, hsep_int preview, hsep_int spacing, hsep_int shared);

/* Fill the block, which is 0, at rest, for plans of these splines. */
HSEP_API void hsep_stop_init(hsep_stop *self, const hsep_splines *splines, hsep_int preview, hsep_int shared);

/* Shorten a plan, (3 + n,) m, to what has a stop, and keep that. x_d: (preview,) m, commanded positions; before it the
 * last three ones, m, and their changes. Cost: 250 operations a sample of the preview. */
HSEP_API void hsep_stop_carry_out(
    hsep_stop *self, const hsep_splines *splines, const hsep_real x_d[], const hsep_real x_d_before[3],
    const hsep_real delta_before[3], hsep_real plan[]);

/* Move on by a window of so many splines. */
HSEP_API void hsep_stop_next(hsep_stop *self, hsep_int kept);

#endif

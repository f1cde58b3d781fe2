/* The drive's limits as bounds on the rows of a plan (hsep_splines.h), in shares of a limit. Private to hsep_planner.c.
 * Reentrant; allocate nothing. */
#ifndef HSEP_CONSTRAINTS_H
#define HSEP_CONSTRAINTS_H

#include "hsep_api.h"
#include "hsep_planner.h"

#include <stdint.h>

/* The rows of x_dm, and of delta in order 0, under the rest of the last plan, in shares; and which way x_d moves. */
HSEP_API void hsep_constraints_total(hsep_planner *self, const double x_d[]);

/* What a row may be, in shares. What the rest of the last plan demands is always allowed, and a little more: bounds
 * without an interior are none for an interior-point method. */
HSEP_API void hsep_constraints_range(const hsep_planner *self, uint64_t r, double *least, double *most);

/* The largest share, 0 ... 1, of the way from the rest, whose rows are in total, by rows of way, within the limits. */
HSEP_API double hsep_constraints_share(const hsep_planner *self, const double way[]);

/* Whether the rows of way, added to those of the rest, keep the limits. */
HSEP_API int hsep_constraints_allow(const hsep_planner *self, const double way[]);

#endif

/* Drive limits as linear constraints on the rows of a plan (hsep_splines.h), in shares of a limit. Private to
 * hsep_planner.c. Reentrant; allocate nothing. */
#ifndef HSEP_CONSTRAINTS_H
#define HSEP_CONSTRAINTS_H

#include "hsep_api.h"
#include "hsep_plan.h"
#include "hsep_real.h"

/* Rows of x_dm, of delta in order 0, under the remainder of the last plan, in shares; and the direction of x_d. */
HSEP_API void hsep_constraints_total(hsep_planner *self, const hsep_real x_d[]);

/* Bounds of a row, in shares. The remainder of the last plan is always feasible, with a small margin: an
 * interior-point method needs an interior. */
HSEP_API void hsep_constraints_range(const hsep_planner *self, hsep_int r, hsep_real *least, hsep_real *most);

/* Largest feasible step length, 0 ... 1, by a step with rows way, from a feasible plan, whose rows are those of the
 * remainder and from. */
HSEP_API hsep_real hsep_constraints_share(const hsep_planner *self, const hsep_real from[], const hsep_real way[]);

/* Whether the remainder and a step with rows way are feasible. */
HSEP_API int hsep_constraints_allow(const hsep_planner *self, const hsep_real way[]);

#endif

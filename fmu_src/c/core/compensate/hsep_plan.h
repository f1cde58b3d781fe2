/* Memory of a planner (hsep_planner.h), which its constraints read too. */
#ifndef HSEP_PLAN_H
#define HSEP_PLAN_H

#include "hsep_layout.h"
#include "hsep_real.h"
#include "hsep_splines.h"

typedef struct {
    hsep_int Np;
    hsep_int n_pinned; /* splines of a bounded plan that stay as they were */
    hsep_int no_reversal;
    hsep_real jerk_weight;
    hsep_real delta_before[3], x_d_before[3]; /* m, of the samples before the plan */
    /* Offsets in words from the beginning of the struct */
    hsep_int c;      /* (3 + n,) m, coefficients */
    hsep_int total;  /* (4 preview,) rows of x_dm under the remainder of the last plan, in shares */
    hsep_int moves;  /* (preview,) which way x_d moves: -1, 0, 1; 0 where that does not matter */
    hsep_int third;  /* (preview,) m, third differences of what is decided */
    hsep_int P;      /* triangle of n rows */
    hsep_int factor; /* triangle of n rows */
    hsep_int splines, interior;
} hsep_planner;

HSEP_ASSERT_WORDS(hsep_planner, 18);

/* The splines of a plan; hsep_splines_shape is to be filtered. */
static inline const hsep_splines *hsep_planner_splines(const hsep_planner *self)
{
    return (const hsep_splines *)hsep_at_const(self, self->splines);
}

/* delta at sample k of the plan, m; of a bounded one that is not solved yet, at its first hsep_planner_pinned. */
static inline hsep_real hsep_planner_delta(const hsep_planner *self, hsep_int k)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    return hsep_splines_sum(splines, hsep_at_const(self, self->c), HSEP_N_DECIDED + splines->n, k);
}

#endif

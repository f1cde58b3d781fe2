/* Memory of a planner (hsep_planner.h), which its constraints read too. */
#ifndef HSEP_PLAN_H
#define HSEP_PLAN_H

#include "hsep_layout.h"
#include "hsep_splines.h"

#include <stdint.h>

typedef struct {
    uint64_t Np;
    uint64_t n_pinned; /* splines of a bounded plan that stay as they were */
    uint64_t no_reversal;
    double jerk_weight;
    double delta_before[3], x_d_before[3]; /* m, of the samples before the plan */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t c;      /* (3 + n,) m, coefficients */
    uint64_t total;  /* (4 preview,) rows of x_dm under the rest of the last plan, in shares */
    uint64_t moves;  /* (preview,) which way x_d moves: -1, 0, 1; 0 where that does not matter */
    uint64_t third;  /* (preview,) m, third differences of what is decided */
    uint64_t P;      /* triangle of n rows */
    uint64_t factor; /* triangle of n rows */
    uint64_t splines, interior;
} hsep_planner;

HSEP_ASSERT_WORDS(hsep_planner, 18);

/* The splines of a plan; hsep_splines_shape is to be filtered. */
static inline const hsep_splines *hsep_planner_splines(const hsep_planner *self)
{
    return (const hsep_splines *)hsep_at_const(self, self->splines);
}

/* delta at sample k of the plan, m; of a bounded one that is not solved yet, at its first hsep_planner_pinned. */
static inline double hsep_planner_delta(const hsep_planner *self, uint64_t k)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    return hsep_splines_sum(splines, hsep_at_const(self, self->c), HSEP_DECIDED + splines->n, k);
}

#endif

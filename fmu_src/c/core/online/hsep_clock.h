/* Sample clock: communication steps of any size in samples; the instants are t_k = start + k T_s.
 *
 * The clock keeps its own time, the compensated sum of the step sizes, because the importer's time may be rounded or
 * drift. An instant within delta = max(1e-6 T_s, 8 ulp(t)) of a step's start belongs to that step, where the inputs of
 * sample k are latched at t_k; the sample is executed in the step whose end reaches t_{k+1}.
 * Plain data; reentrant; allocates nothing; constant cost.
 */
#ifndef HSEP_CLOCK_H
#define HSEP_CLOCK_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_CLOCK_STEP_MAX 100.0 /* s */

typedef struct {
    double start;    /* s */
    double T_s;      /* s */
    int64_t k;       /* index of the last instant reached, t_k */
    double since;    /* s, from t_k to now; slightly below 0 where a step ended within delta before t_k */
    double carry;    /* s, accumulated rounding error of since */
    double end;      /* s, end of the last step in the importer's time */
    int64_t latched; /* whether the inputs of sample k have been read */
} hsep_clock;

HSEP_ASSERT_WORDS(hsep_clock, 7);

/* One communication step in samples. */
typedef struct {
    hsep_clock after;  /* the clock at the step's end */
    int64_t n_samples; /* samples that the step executes */
    int64_t n_latched; /* instants whose inputs are read in it, one after the other */
    double first;      /* s, from the step's start to the first of them; may be slightly below 0 */
    int inside;        /* whether one of them is no communication point */
} hsep_clock_step;

/* Begin at start, s. Fails, and returns 0, if doubles near start do not resolve T_s / 4. */
HSEP_API int hsep_clock_init(hsep_clock *self, double start, double T_s);

/* Count the step from t by h, s, with 0 < h <= HSEP_CLOCK_STEP_MAX; self is unchanged until the caller takes over
 * step->after. Fails, and returns 0, if t is not where the last step ended. */
HSEP_API int hsep_clock_count(const hsep_clock *self, double t, double h, hsep_clock_step *step);

/* Whether the fields of a clock from a state are in range. */
HSEP_API int hsep_clock_valid(const hsep_clock *self);

#endif

/* Sample clock: communication steps of any size in samples of T_s.
 *
 * The clock keeps its own time, the compensated sum of the step sizes: the importer's may be rounded or drift. An
 * instant within delta = max(0.05 T_s, 8 ulp(t)) of a communication point, or half a step where that is less, is at
 * that point, and the next one is counted from there: the grid of samples follows the importer's. Elsewhere instants
 * are T_s apart. An instant at a step's start belongs to that step, where the inputs of sample k are latched; the
 * sample is executed in the step whose end reaches the next instant.
 * Plain data; reentrant; allocates nothing; constant cost.
 */
#ifndef HSEP_CLOCK_H
#define HSEP_CLOCK_H

#include "hsep_layout.h"

#define HSEP_CLOCK_STEP_MAX 100.0 /* s */

typedef struct {
    double T_s;   /* s */
    int64_t k;    /* index of the last instant reached */
    double since; /* s, from that instant to now; 0 where it is at the communication point */
    double carry; /* s, accumulated rounding error of since */
    double end;   /* s, end of the last step in the importer's time */
} hsep_clock;
HSEP_ASSERT_WORDS(hsep_clock, 5);

/* One communication step in samples. */
typedef struct {
    hsep_clock after;  /* the clock at the step's end */
    int64_t n_samples; /* samples that the step executes */
    int64_t n_latched; /* instants whose inputs are read in it, one after the other */
    double first;      /* s, from the step's start to the first of them */
    int inside;        /* whether one of them is no communication point */
    double moved;      /* s, by which the last instant lay before the step's end, where it was taken; < 0: after it */
    int noticed;       /* whether that is more than rounding of times */
} hsep_clock_step;

/* Begin at start, s. Fails, and returns 0, if doubles near start do not resolve T_s / 4. */
HSEP_API int hsep_clock_init(hsep_clock *self, double start, double T_s);

/* Whether a step may begin at t where the last one ended at end, s: tolerance, s, is the largest difference that may be
 * rounding; where doubles are coarser, a few of their spacings. */
HSEP_API int hsep_clock_follows(double end, double t, double tolerance);

/* Whether the inputs of sample k have been read: a step began at its instant. */
HSEP_API int hsep_clock_latched(const hsep_clock *self);

/* Count the step from t by h, s, with 0 < h <= HSEP_CLOCK_STEP_MAX; self is unchanged until the caller takes over
 * step->after. Fails, and returns 0, if t is not where the last step ended. */
HSEP_API int hsep_clock_count(const hsep_clock *self, double t, double h, hsep_clock_step *step);

#endif

/* From communication points to sample numbers: samples of T_s are counted in integers, t_k = start + k T_s, and
 * sub-steps divide a sample evenly. Plain data; reentrant; allocates nothing; constant cost. */
#ifndef HSEP_CLOCK_H
#define HSEP_CLOCK_H

#include "hsep_api.h"

#include <stdint.h>

typedef struct {
    double start; /* s */
    double T_s;   /* s */
    int64_t k;     /* sample in progress */
    int64_t done;  /* sub-steps done of this sample */
    int64_t parts; /* sub-steps that it is made of */
} hsep_clock;

typedef enum {
    HSEP_CLOCK_FITS = 0,
    HSEP_CLOCK_STEP_SIZE,  /* h does not divide T_s */
    HSEP_CLOCK_MIXED_SIZE, /* h differs from the one this sample began with */
    HSEP_CLOCK_POINT       /* t is not the communication point expected */
} hsep_clock_fit;

HSEP_API void hsep_clock_init(hsep_clock *self, double start, double T_s);

/* Tell whether the step from t by h, s, comes next, and in parts how many such steps make a sample. */
HSEP_API hsep_clock_fit hsep_clock_check(const hsep_clock *self, double t, double h, int64_t *parts);

/* The communication point that comes next if a sample has that many parts, s. */
HSEP_API double hsep_clock_expected(const hsep_clock *self, int64_t parts);

/* Count one sub-step of parts; return whether it completed the sample. */
HSEP_API int hsep_clock_advance(hsep_clock *self, int64_t parts);

#endif

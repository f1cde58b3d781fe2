/* Functions of C's library for hsep_real, with HSEP_FLOAT32 the functions for float; and ranges of numbers. */
#ifndef HSEP_MATH_H
#define HSEP_MATH_H

#include "hsep_real.h"

#include <math.h>

#ifdef HSEP_FLOAT32
#define HSEP_MATH(name) name##f
#else
#define HSEP_MATH(name) name
#endif

#define HSEP_TWO_PI 6.283185307179586

#define hsep_ceil HSEP_MATH(ceil)
#define hsep_cos HSEP_MATH(cos)
#define hsep_exp HSEP_MATH(exp)
#define hsep_fabs HSEP_MATH(fabs)
#define hsep_fmax HSEP_MATH(fmax)
#define hsep_fmin HSEP_MATH(fmin)
#define hsep_frexp HSEP_MATH(frexp)
#define hsep_ldexp HSEP_MATH(ldexp)
#define hsep_pow HSEP_MATH(pow)
#define hsep_sin HSEP_MATH(sin)
#define hsep_sqrt HSEP_MATH(sqrt)
#define hsep_tanh HSEP_MATH(tanh)

#define HSEP_PREDICTION_MAX HSEP_HUGE(1e100) /* m, of what is published: sums of squares of less cannot overflow */

static inline hsep_int hsep_min(hsep_int a, hsep_int b) { return a < b ? a : b; }

/* Whether all entries of a, (n,), are numbers within +- limit. */
static inline int hsep_within(const hsep_real a[], hsep_int n, hsep_real limit)
{
    int within = 1;
    for (hsep_int i = 0; i < n; i++) {
        within &= hsep_fabs(a[i]) <= limit; /* NaN is not */
    }
    return within;
}

/* Largest change from one entry of a to the next, (n,). */
static inline hsep_real hsep_largest_step(const hsep_real a[], hsep_int n)
{
    hsep_real largest = 0.0;
    for (hsep_int i = 1; i < n; i++) {
        largest = hsep_fmax(largest, hsep_fabs(a[i - 1] - a[i]));
    }
    return largest;
}

/* A value within +- bound; bound if it is not a number. */
static inline hsep_real hsep_clip(hsep_real value, hsep_real bound)
{
    const hsep_real below = value < bound ? value : bound;
    return below > -bound ? below : -bound;
}

#endif

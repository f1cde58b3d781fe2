/* Sums and products of vectors, four entries at a time: compilers make vectors of them without knowing n, and no
 * addition waits for the one before. Reentrant; allocate nothing. */
#ifndef HSEP_VECTOR_H
#define HSEP_VECTOR_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define HSEP_PREDICTION_MAX 1e100 /* m, of what is published: sums of squares of what is smaller never overflow */

/* Which prediction of a window is beyond it, because what was learned diverges. */
typedef enum { HSEP_CONVERGES = 0, HSEP_DIVERGES_X_PB, HSEP_DIVERGES_X_H, HSEP_DIVERGES_X_DM } hsep_divergence;

/* Whether all entries of a, (n,) doubles in any alignment, are numbers within +- limit. */
static inline int hsep_within(const void *a, uint64_t n, double limit)
{
    int within = 1;
    for (uint64_t i = 0; i < n; i++) {
        double entry;
        memcpy(&entry, (const char *)a + i * sizeof entry, sizeof entry);
        within &= fabs(entry) <= limit; /* NaN is not */
    }
    return within;
}

/* sum_i a_i b_i, both (n,). */
static inline double hsep_dot(const double a[], const double b[], uint64_t n)
{
    double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
    uint64_t i = 0;
    for (; i + 4 <= n; i += 4) {
        s0 += a[i] * b[i];
        s1 += a[i + 1] * b[i + 1];
        s2 += a[i + 2] * b[i + 2];
        s3 += a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) {
        s0 += a[i] * b[i];
    }
    return (s0 + s1) + (s2 + s3);
}

/* y += a x, both (n,). */
static inline void hsep_axpy(double *restrict y, double a, const double *restrict x, uint64_t n)
{
    uint64_t i = 0;
    for (; i + 4 <= n; i += 4) {
        const double y0 = y[i] + a * x[i], y1 = y[i + 1] + a * x[i + 1];
        const double y2 = y[i + 2] + a * x[i + 2], y3 = y[i + 3] + a * x[i + 3];
        y[i] = y0;
        y[i + 1] = y1;
        y[i + 2] = y2;
        y[i + 3] = y3;
    }
    for (; i < n; i++) {
        y[i] += a * x[i];
    }
}

#endif

/* Sums and products of vectors, four entries at a time: compilers make vectors of them without knowing n, and no
 * addition waits for the one before. Reentrant; allocate nothing. */
#ifndef HSEP_VECTOR_H
#define HSEP_VECTOR_H

#include <stdint.h>

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

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

/* start + sum_i w_i e_i, both (n,), e a recursion's own values, newest first: the newest, which are only just computed,
 * come last, and older ones need not wait for them. */
static inline double hsep_recur(double start, const double w[], const double e[], uint64_t n)
{
    if (n < 4) {
        for (uint64_t i = n; i-- > 0;) {
            start += w[i] * e[i];
        }
        return start;
    }
    start += hsep_dot(w + 4, e + 4, n - 4);
    return (((start + w[3] * e[3]) + w[2] * e[2]) + w[1] * e[1]) + w[0] * e[0];
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

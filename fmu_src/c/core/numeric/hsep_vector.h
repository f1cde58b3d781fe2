/* Vectors of two numbers where the processor has them, one number elsewhere or with HSEP_NO_VECTORS; sums and products
 * of arrays, four entries at a time. Lanes do not meet: results are the same to the last bit whatever a vector holds,
 * and no addition waits for the one before. Reentrant; allocate nothing. */
#ifndef HSEP_VECTOR_H
#define HSEP_VECTOR_H

#include "hsep_real.h"

#include <string.h>

#if (defined(__SSE2__) || defined(__aarch64__) || defined(__VSX__) || defined(__wasm_simd128__)) && \
    (defined(__GNUC__) || defined(__clang__)) && !defined(HSEP_NO_VECTORS)
#define HSEP_LANES 2
typedef hsep_real hsep_lanes __attribute__((vector_size(2 * sizeof(hsep_real)), aligned(sizeof(hsep_real)), may_alias));
#else
#define HSEP_LANES 1
typedef hsep_real hsep_lanes;
#endif

#define HSEP_LANES_MOST 2 /* whatever the compiler has: blocks are the same */

/* The larger one of two numbers, lane by lane, b if a is none; and the largest one of a vector. */
#if HSEP_LANES == 2
static inline hsep_lanes hsep_larger(hsep_lanes a, hsep_lanes b)
{
    typedef hsep_signed mask __attribute__((vector_size(2 * sizeof(hsep_signed))));
    const mask is = a > b;
    return (hsep_lanes)((is & (mask)a) | (~is & (mask)b));
}
static inline hsep_real hsep_largest(hsep_lanes a) { return a[0] > a[1] ? a[0] : a[1]; }
#else
static inline hsep_lanes hsep_larger(hsep_lanes a, hsep_lanes b) { return a > b ? a : b; }
static inline hsep_real hsep_largest(hsep_lanes a) { return a; }
#endif

/* Vectors that hold four numbers. */
#define HSEP_OF_FOUR (4 / HSEP_LANES)

/* The vectors that begin at a number, in any alignment of numbers. */
static inline hsep_lanes *hsep_lanes_at(hsep_real *a) { return (hsep_lanes *)(void *)a; }
static inline const hsep_lanes *hsep_lanes_const(const hsep_real *a) { return (const hsep_lanes *)(const void *)a; }

/* to := from, n words, which may overlap; return to. */
static inline void *hsep_copy(void *to, const void *from, hsep_int n)
{
    return memmove(to, from, (size_t)n * sizeof(hsep_real));
}
static inline void hsep_zero(hsep_real to[], hsep_int n) { memset(to, 0, (size_t)n * sizeof(hsep_real)); }

/* sum_i a_i b_i, both (n,). */
static inline hsep_real hsep_dot(const hsep_real a[], const hsep_real b[], hsep_int n)
{
    hsep_lanes sums[HSEP_OF_FOUR];
    hsep_real s[4] = {0.0, 0.0, 0.0, 0.0};
    hsep_int i = 0;
    memcpy(sums, s, sizeof s);
    for (; i + 4 <= n; i += 4) {
        const hsep_lanes *x = hsep_lanes_const(a + i), *y = hsep_lanes_const(b + i);
        for (int l = 0; l < HSEP_OF_FOUR; l++) {
            sums[l] += x[l] * y[l];
        }
    }
    memcpy(s, sums, sizeof s);
    for (; i < n; i++) {
        s[0] += a[i] * b[i];
    }
    return (s[0] + s[1]) + (s[2] + s[3]);
}

/* sums_c := sum_i a_i b_c,i of four arrays side by side, all (n,): a is loaded once for all. Each sum has a name, as
 * compilers keep no array of them in registers: without, a predictor's dearest sample is 8 % dearer on a Cortex-M7. */
static inline void hsep_dot_four(const hsep_real a[], const hsep_real *const b[4], hsep_int n, hsep_real sums[4])
{
    const hsep_real *b0 = b[0], *b1 = b[1], *b2 = b[2], *b3 = b[3];
    hsep_int i = 0;
#if HSEP_LANES == 2
    hsep_lanes s0 = {0.0}, s1 = {0.0}, s2 = {0.0}, s3 = {0.0};
    for (; i + 2 <= n; i += 2) {
        const hsep_lanes x = *hsep_lanes_const(a + i);
        s0 += x * *hsep_lanes_const(b0 + i);
        s1 += x * *hsep_lanes_const(b1 + i);
        s2 += x * *hsep_lanes_const(b2 + i);
        s3 += x * *hsep_lanes_const(b3 + i);
    }
    sums[0] = s0[0] + s0[1], sums[1] = s1[0] + s1[1], sums[2] = s2[0] + s2[1], sums[3] = s3[0] + s3[1];
#else
    hsep_real s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0, t0 = 0.0, t1 = 0.0, t2 = 0.0, t3 = 0.0;
    for (; i + 2 <= n; i += 2) {
        s0 += a[i] * b0[i], t0 += a[i + 1] * b0[i + 1];
        s1 += a[i] * b1[i], t1 += a[i + 1] * b1[i + 1];
        s2 += a[i] * b2[i], t2 += a[i + 1] * b2[i + 1];
        s3 += a[i] * b3[i], t3 += a[i + 1] * b3[i + 1];
    }
    sums[0] = s0 + t0, sums[1] = s1 + t1, sums[2] = s2 + t2, sums[3] = s3 + t3;
#endif
    for (; i < n; i++) {
        sums[0] += a[i] * b0[i], sums[1] += a[i] * b1[i];
        sums[2] += a[i] * b2[i], sums[3] += a[i] * b3[i];
    }
}

/* start + sum_i w_i e_i, both (n,), e a recursion's own values, newest first: the newest, which are only just computed,
 * come last, and older ones need not wait for them. */
static inline hsep_real hsep_recur(hsep_real start, const hsep_real w[], const hsep_real e[], hsep_int n)
{
    if (n < 4) {
        for (hsep_int i = n; i-- > 0;) {
            start += w[i] * e[i];
        }
        return start;
    }
    start += hsep_dot(w + 4, e + 4, n - 4);
    return (((start + w[3] * e[3]) + w[2] * e[2]) + w[1] * e[1]) + w[0] * e[0];
}

/* y += a x, both (n,). */
static inline void hsep_axpy(hsep_real *restrict y, hsep_real a, const hsep_real *restrict x, hsep_int n)
{
    const hsep_int whole = n - n % HSEP_LANES;
    for (hsep_int j = 0; j < whole; j += HSEP_LANES) {
        *hsep_lanes_at(y + j) += a * *hsep_lanes_const(x + j);
    }
    for (hsep_int j = whole; j < n; j++) {
        y[j] += a * x[j];
    }
}

static inline hsep_real hsep_lesser(hsep_real a, hsep_real b) { return a < b ? a : b; } /* one instruction */

/* The first place in a, (n,), n > 0, of what is at most same, or else of the least. */
static inline hsep_int hsep_place_of_least(const hsep_real a[], hsep_int n, hsep_real same)
{
    hsep_int place = 0;
    for (hsep_int i = 1; i < n && a[place] > same; i++) {
        for (const hsep_real least = a[place]; i + 4 <= n; i += 4) { /* most hold none that is less */
            if (hsep_lesser(hsep_lesser(a[i], a[i + 1]), hsep_lesser(a[i + 2], a[i + 3])) < least) {
                break;
            }
        }
        if (i < n && a[i] < a[place]) {
            place = i;
        }
    }
    return place;
}

/* What is left of y after sum_r a_r x_r over four arrays x_r, one after the other: of numbers or vectors at j. */
#define HSEP_TAKE(y, a0, x0, a1, x1, a2, x2, a3, x3, at, j) \
    (((((y) - (a0) * *at((x0) + (j))) - (a1) * *at((x1) + (j))) - (a2) * *at((x2) + (j))) - (a3) * *at((x3) + (j)))
#define HSEP_NUMBER(a) (a)

/* y -= sum_r a_r x_r over 4 or 8 arrays x_r, all (n,), one after the other: y is loaded and stored once for all. */
static inline void hsep_take_four(hsep_real *restrict y, const hsep_real a[4], const hsep_real *const x[4], hsep_int n)
{
    const hsep_real a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
    const hsep_real *x0 = x[0], *x1 = x[1], *x2 = x[2], *x3 = x[3];
    const hsep_int whole = n - n % HSEP_LANES;
    hsep_int j = 0;
    for (; j < whole; j += HSEP_LANES) {
        hsep_lanes *to = hsep_lanes_at(y + j);
        *to = HSEP_TAKE(*to, a0, x0, a1, x1, a2, x2, a3, x3, hsep_lanes_const, j);
    }
    for (; j < n; j++) {
        y[j] = HSEP_TAKE(y[j], a0, x0, a1, x1, a2, x2, a3, x3, HSEP_NUMBER, j);
    }
}

static inline void hsep_take_eight(hsep_real *restrict y, const hsep_real a[8], const hsep_real *const x[8], hsep_int n)
{
    const hsep_real a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3], a4 = a[4], a5 = a[5], a6 = a[6], a7 = a[7];
    const hsep_real *x0 = x[0], *x1 = x[1], *x2 = x[2], *x3 = x[3], *x4 = x[4], *x5 = x[5], *x6 = x[6], *x7 = x[7];
    const hsep_int whole = n - n % HSEP_LANES;
    hsep_int j = 0;
    for (; j < whole; j += HSEP_LANES) {
        hsep_lanes *to = hsep_lanes_at(y + j);
        const hsep_lanes first = HSEP_TAKE(*to, a0, x0, a1, x1, a2, x2, a3, x3, hsep_lanes_const, j);
        *to = HSEP_TAKE(first, a4, x4, a5, x5, a6, x6, a7, x7, hsep_lanes_const, j);
    }
    for (; j < n; j++) {
        const hsep_real first = HSEP_TAKE(y[j], a0, x0, a1, x1, a2, x2, a3, x3, HSEP_NUMBER, j);
        y[j] = HSEP_TAKE(first, a4, x4, a5, x5, a6, x6, a7, x7, HSEP_NUMBER, j);
    }
}

#endif

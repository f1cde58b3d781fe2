#include "hsep_cholesky.h"

#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>

/* y -= a_0 x_0 + a_1 x_1 + a_2 x_2 + a_3 x_3: y is loaded and stored once for four rows. */
static void cholesky_take(
    double *restrict y, const double a[4], const double *restrict x0, const double *restrict x1,
    const double *restrict x2, const double *restrict x3, uint64_t n)
{
    const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
    uint64_t j = 0;
    for (; j + HSEP_LANES <= n; j += HSEP_LANES) {
        *hsep_lanes_at(y + j) -= (a0 * *hsep_lanes_const(x0 + j) + a1 * *hsep_lanes_const(x1 + j)) +
                                 (a2 * *hsep_lanes_const(x2 + j) + a3 * *hsep_lanes_const(x3 + j));
    }
    for (; j < n; j++) {
        y[j] -= (a0 * x0[j] + a1 * x1[j]) + (a2 * x2[j] + a3 * x3[j]);
    }
}

/* The same for row i, y, and row i + 1, z, from its diagonal on: x_r are loaded once for both. n: of y, at least 2. */
static void cholesky_take_two(
    double *restrict y, double *restrict z, const double a[4], const double *restrict x0, const double *restrict x1,
    const double *restrict x2, const double *restrict x3, uint64_t n)
{
    const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
    const double b0 = x0[1], b1 = x1[1], b2 = x2[1], b3 = x3[1];
    uint64_t j = 1;
    y[0] -= (a0 * x0[0] + a1 * x1[0]) + (a2 * x2[0] + a3 * x3[0]);
    for (; j + HSEP_LANES <= n; j += HSEP_LANES) {
        const hsep_lanes p0 = *hsep_lanes_const(x0 + j), p1 = *hsep_lanes_const(x1 + j);
        const hsep_lanes p2 = *hsep_lanes_const(x2 + j), p3 = *hsep_lanes_const(x3 + j);
        *hsep_lanes_at(y + j) -= (a0 * p0 + a1 * p1) + (a2 * p2 + a3 * p3);
        *hsep_lanes_at(z + j - 1) -= (b0 * p0 + b1 * p1) + (b2 * p2 + b3 * p3);
    }
    for (; j < n; j++) {
        y[j] -= (a0 * x0[j] + a1 * x1[j]) + (a2 * x2[j] + a3 * x3[j]);
        z[j - 1] -= (b0 * x0[j] + b1 * x1[j]) + (b2 * x2[j] + b3 * x3[j]);
    }
}

/* Divide row k, (length,), by the root of its pivot; return whether there is one. least: bound on the pivot, or none. */
static int cholesky_pivot(double row[], uint64_t length, const double *least)
{
    if (least != NULL && !(row[0] >= *least)) {
        row[0] = *least;
    }
    if (!(row[0] > 0.0 && row[0] < HUGE_VAL)) {
        return 0;
    }
    const double root = sqrt(row[0]), inverse = 1.0 / root;
    row[0] = root;
    for (uint64_t j = 1; j < length; j++) {
        row[j] *= inverse;
    }
    return 1;
}

HSEP_API int hsep_cholesky_factor(double triangle[], uint64_t n, const double least[])
{
    double *row = triangle;
    uint64_t k = 0;
    for (; k + 4 <= n; k += 4) {
        double *x[4] = {row, row + (n - k), row + (2 * (n - k) - 1), row + (3 * (n - k) - 3)};
        for (uint64_t r = 0; r < 4; r++) { /* four rows among themselves */
            for (uint64_t above = 0; above < r; above++) {
                hsep_axpy(x[r], -x[above][r - above], x[above] + (r - above), n - k - r);
            }
            if (!cholesky_pivot(x[r], n - k - r, least != NULL ? least + k + r : NULL)) {
                return 0;
            }
        }
        double *y = x[3] + (n - k - 3);
        for (uint64_t i = k + 4; i < n; i += 2) { /* and what they leave of the rows below */
            const uint64_t at = i - k;
            const double a[4] = {x[0][at], x[1][at - 1], x[2][at - 2], x[3][at - 3]};
            const double *from[4] = {x[0] + at, x[1] + at - 1, x[2] + at - 2, x[3] + at - 3};
            if (i + 1 < n) {
                cholesky_take_two(y, y + (n - i), a, from[0], from[1], from[2], from[3], n - i);
            } else {
                cholesky_take(y, a, from[0], from[1], from[2], from[3], n - i);
            }
            y += (n - i) + (n - i - 1);
        }
        row = x[3] + (n - k - 3);
    }
    for (; k < n; k++) {
        if (!cholesky_pivot(row, n - k, least != NULL ? least + k : NULL)) {
            return 0;
        }
        double *y = row + (n - k);
        for (uint64_t i = k + 1; i < n; i++) {
            hsep_axpy(y, -row[i - k], row + (i - k), n - i);
            y += n - i;
        }
        row += n - k;
    }
    return 1;
}

HSEP_API void hsep_cholesky_solve(const double triangle[], uint64_t n, double b[])
{
    const double *row = triangle;
    for (uint64_t i = 0; i < n; i++) { /* R' y = b */
        b[i] /= row[0];
        hsep_axpy(b + i + 1, -b[i], row + 1, n - i - 1);
        row += n - i;
    }
    for (uint64_t i = n; i-- > 0;) { /* R x = y */
        row -= n - i;
        b[i] = (b[i] - hsep_dot(row + 1, b + i + 1, n - i - 1)) / row[0];
    }
}

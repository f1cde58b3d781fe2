#include "hsep_cholesky.h"

#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>

/* Divide row k, (length,), by the root of its pivot; return whether there is one. least: bound on it, or NULL. */
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

/* Rows of a triangle that are finished together. */
#define CHOLESKY_PANEL 8

/* Finish count rows, from row k of n on, of which those above have been taken; return whether they have pivots. */
static int cholesky_panel(double *const rows[CHOLESKY_PANEL], uint64_t count, uint64_t length, const double least[])
{
    for (uint64_t r = 0; r < count; r++) {
        uint64_t above = 0;
        if (r >= 4) {
            const double a[4] = {rows[0][r], rows[1][r - 1], rows[2][r - 2], rows[3][r - 3]};
            const double *const x[4] = {rows[0] + r, rows[1] + r - 1, rows[2] + r - 2, rows[3] + r - 3};
            hsep_take_four(rows[r], a, x, length - r);
            above = 4;
        }
        for (; above < r; above++) {
            hsep_axpy(rows[r], -rows[above][r - above], rows[above] + (r - above), length - r);
        }
        if (!cholesky_pivot(rows[r], length - r, least != NULL ? least + r : NULL)) {
            return 0;
        }
    }
    return 1;
}

HSEP_API int hsep_cholesky_factor(double triangle[], uint64_t n, const double least[])
{
    double *row = triangle;
    for (uint64_t k = 0; k < n; k += CHOLESKY_PANEL) {
        const uint64_t length = n - k, count = length < CHOLESKY_PANEL ? length : CHOLESKY_PANEL;
        double *rows[CHOLESKY_PANEL] = {NULL};
        for (uint64_t r = 0; r < count; r++) {
            rows[r] = row;
            row += length - r;
        }
        if (!cholesky_panel(rows, count, length, least != NULL ? least + k : NULL)) {
            return 0;
        }
        double *y = row;
        for (uint64_t i = CHOLESKY_PANEL; i < length; i++) { /* what they leave of the rows below */
            double a[CHOLESKY_PANEL];
            const double *x[CHOLESKY_PANEL];
            for (uint64_t r = 0; r < CHOLESKY_PANEL; r++) {
                x[r] = rows[r] + (i - r);
                a[r] = *x[r];
            }
            hsep_take_eight(y, a, x, length - i);
            y += length - i;
        }
    }
    return 1;
}

HSEP_API void hsep_cholesky_solve(const double triangle[], uint64_t n, double b[])
{
    const double *row = triangle;
    for (uint64_t first = 0; first < n; first += CHOLESKY_PANEL) { /* R' y = b */
        const uint64_t left = n - first, count = left < CHOLESKY_PANEL ? left : CHOLESKY_PANEL;
        const double *x[CHOLESKY_PANEL] = {NULL};
        double *y = b + first;
        for (uint64_t r = 0; r < count; r++) {
            y[r] /= row[0];
            for (uint64_t j = 1; r + j < count; j++) {
                y[r + j] -= y[r] * row[j];
            }
            x[r] = row + (CHOLESKY_PANEL - r);
            row += left - r;
        }
        if (left > CHOLESKY_PANEL) {
            hsep_take_eight(y + CHOLESKY_PANEL, y, x, left - CHOLESKY_PANEL);
        }
    }
    for (uint64_t i = n; i-- > 0;) { /* R x = y */
        row -= n - i;
        b[i] = (b[i] - hsep_dot(row + 1, b + i + 1, n - i - 1)) / row[0];
    }
}

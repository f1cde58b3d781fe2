#include "hsep_cholesky.h"

#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>

/* Divide row k, (length,), by the root of its pivot; return whether there is one. least: bound on it, or NULL. */
static int cholesky_pivot(hsep_real row[], hsep_word length, const hsep_real *least)
{
    if (least != NULL && !(row[0] >= *least)) {
        row[0] = *least;
    }
    if (!(row[0] > 0.0 && row[0] < INFINITY)) {
        return 0;
    }
    const hsep_real root = hsep_sqrt(row[0]), inverse = 1.0 / root;
    row[0] = root;
    for (hsep_word j = 1; j < length; j++) {
        row[j] *= inverse;
    }
    return 1;
}

/* Rows of a triangle that are finished together. */
#define CHOLESKY_PANEL 8

/* Finish count rows, from row k of n on, from which the rows above have been subtracted; return whether they have
 * pivots. */
static int cholesky_panel(
    hsep_real *const rows[CHOLESKY_PANEL], hsep_word count, hsep_word length, const hsep_real least[])
{
    for (hsep_word r = 0; r < count; r++) {
        hsep_word above = 0;
        if (r >= 4) {
            const hsep_real a[4] = {rows[0][r], rows[1][r - 1], rows[2][r - 2], rows[3][r - 3]};
            const hsep_real *const x[4] = {rows[0] + r, rows[1] + r - 1, rows[2] + r - 2, rows[3] + r - 3};
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

HSEP_API int hsep_cholesky_factor(hsep_real triangle[], hsep_word n, const hsep_real least[])
{
    hsep_real *row = triangle;
    for (hsep_word k = 0; k < n; k += CHOLESKY_PANEL) {
        const hsep_word length = n - k, count = length < CHOLESKY_PANEL ? length : CHOLESKY_PANEL;
        hsep_real *rows[CHOLESKY_PANEL] = {NULL};
        for (hsep_word r = 0; r < count; r++) {
            rows[r] = row;
            row += length - r;
        }
        if (!cholesky_panel(rows, count, length, least != NULL ? least + k : NULL)) {
            return 0;
        }
        hsep_real *y = row;
        for (hsep_word i = CHOLESKY_PANEL; i < length; i++) { /* what they leave of the rows below */
            hsep_real a[CHOLESKY_PANEL];
            const hsep_real *x[CHOLESKY_PANEL];
            for (hsep_word r = 0; r < CHOLESKY_PANEL; r++) {
                x[r] = rows[r] + (i - r);
                a[r] = *x[r];
            }
            hsep_take_eight(y, a, x, length - i);
            y += length - i;
        }
    }
    return 1;
}

HSEP_API void hsep_cholesky_solve(const hsep_real triangle[], hsep_word n, hsep_real b[])
{
    const hsep_real *row = triangle;
    for (hsep_word first = 0; first < n; first += CHOLESKY_PANEL) { /* R' y = b */
        const hsep_word left = n - first, count = left < CHOLESKY_PANEL ? left : CHOLESKY_PANEL;
        const hsep_real *x[CHOLESKY_PANEL] = {NULL};
        hsep_real *y = b + first;
        for (hsep_word r = 0; r < count; r++) {
            y[r] /= row[0];
            for (hsep_word j = 1; r + j < count; j++) {
                y[r + j] -= y[r] * row[j];
            }
            x[r] = row + (CHOLESKY_PANEL - r);
            row += left - r;
        }
        if (left > CHOLESKY_PANEL) {
            hsep_take_eight(y + CHOLESKY_PANEL, y, x, left - CHOLESKY_PANEL);
        }
    }
    for (hsep_word i = n; i-- > 0;) { /* R x = y */
        row -= n - i;
        b[i] = (b[i] - hsep_dot(row + 1, b + i + 1, n - i - 1)) / row[0];
    }
}

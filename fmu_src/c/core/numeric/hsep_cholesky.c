#include "hsep_cholesky.h"

/* Divide a row, (length,), by the root of its pivot; return whether there is one. least: bound on it, or NULL. Apart
 * from the panel, whose registers are taken. */
static int cholesky_pivot(hsep_real row[], hsep_int length, const hsep_real *least)
{
    if (least != NULL && !(row[0] >= *least)) {
        row[0] = *least;
    }
    if (!(row[0] > 0.0 && row[0] < INFINITY)) {
        return 0;
    }
    const hsep_real root = hsep_sqrt(row[0]), inverse = 1.0 / root;
    row[0] = root;
    for (hsep_int j = 1; j < length; j++) {
        row[j] *= inverse;
    }
    return 1;
}

/* Finish count rows, from which those above the panel have been subtracted; return whether they have pivots. */
static int cholesky_panel(
    hsep_real *const rows[HSEP_CHOLESKY_PANEL], hsep_int count, hsep_int length, const hsep_real least[])
{
    for (hsep_int r = 0; r < count; r++) {
        hsep_real a[HSEP_CHOLESKY_PANEL];
        const hsep_real *x[HSEP_CHOLESKY_PANEL];
        for (hsep_int above = 0; above < r; above++) {
            x[above] = rows[above] + (r - above);
            a[above] = *x[above];
        }
        if (r >= 4) {
            hsep_take_four(rows[r], a, x, length - r);
        }
        for (hsep_int above = r - r % 4; above < r; above++) {
            hsep_axpy(rows[r], -a[above], x[above], length - r);
        }
        if (!cholesky_pivot(rows[r], length - r, least != NULL ? least + r : NULL)) {
            return 0;
        }
    }
    return 1;
}

HSEP_API int hsep_cholesky_rows(
    hsep_real triangle[], hsep_int n, hsep_int first, hsep_int last, const hsep_real least[])
{
    hsep_real *row = triangle + (hsep_int)(hsep_triangle(n) - hsep_triangle(n - first));
    for (hsep_int k = first; k < last; k += HSEP_CHOLESKY_PANEL) {
        const hsep_int length = n - k, count = hsep_min(last - k, HSEP_CHOLESKY_PANEL);
        hsep_real *rows[HSEP_CHOLESKY_PANEL], a[HSEP_CHOLESKY_PANEL];
        const hsep_real *x[HSEP_CHOLESKY_PANEL]; /* what they have in the column of a row below, and after it */
        for (hsep_int r = 0; r < count; r++) {
            rows[r] = row;
            x[r] = row + (count - r);
            row += length - r;
        }
        if (!cholesky_panel(rows, count, length, least != NULL ? least + k : NULL)) {
            return 0;
        }
        hsep_real *y = row;
        for (hsep_int below = length - count; below > 0; below--) { /* what they leave of the rows below */
            for (hsep_int r = 0; r < count; r++) {
                a[r] = *x[r]++;
                *y -= a[r] * a[r];
            }
            y++;
            if (count == HSEP_CHOLESKY_PANEL) {
                hsep_take_eight(y, a, x, below - 1);
            } else {
                for (hsep_int r = 0; r < count; r++) {
                    hsep_axpy(y, -a[r], x[r], below - 1);
                }
            }
            y += below - 1;
        }
    }
    return 1;
}

/* The reflection of a pivot and the entries below it: its length, entries relative to the first one, and factor. */
typedef struct {
    hsep_real norm, v[4], tau;
} cholesky_reflection;

static cholesky_reflection cholesky_reflect(hsep_real pivot, const hsep_real x[], hsep_int stride, hsep_int count)
{
    cholesky_reflection self = {0.0, {0.0}, 0.0};
    hsep_real square = pivot * pivot;
    for (hsep_int i = 0; i < count; i++) {
        square += x[stride * i] * x[stride * i];
    }
    self.norm = hsep_sqrt(square);
    const hsep_real sum = pivot + self.norm;
    for (hsep_int i = 0; i < count; i++) {
        self.v[i] = x[stride * i] / sum;
    }
    self.tau = sum / self.norm;
    return self;
}

HSEP_API void hsep_cholesky_take_one(hsep_real triangle[], hsep_int n, hsep_int head, hsep_real x[])
{
    hsep_real *row = triangle;
    for (hsep_int k = 0; k < n; k++) {
        const hsep_int length = n - k;
        if (k >= head) {
            hsep_axpy(row, x[k], x + k, length);
        } else {
            const cholesky_reflection h = cholesky_reflect(row[0], x + k, 0, 1);
            const hsep_real v = h.v[0], tau = h.tau;
            hsep_real *restrict r = row, *restrict y = x + k;
            hsep_int j = 1;
            for (; j + HSEP_LANES <= length; j += HSEP_LANES) {
                hsep_lanes *of = hsep_lanes_at(r + j), *left = hsep_lanes_at(y + j);
                const hsep_lanes w = tau * (*of + v * *left);
                *of = w - *of;
                *left -= v * w;
            }
            for (; j < length; j++) {
                const hsep_real w = tau * (r[j] + v * y[j]);
                r[j] = w - r[j];
                y[j] -= v * w;
            }
            row[0] = h.norm;
        }
        row += length;
    }
}

HSEP_API void hsep_cholesky_take_four(hsep_real triangle[], hsep_int n, hsep_int head, hsep_real x[])
{
    hsep_real *row = triangle;
    for (hsep_int k = 0; k < n; k++) {
        const hsep_int length = n - k;
        hsep_real *restrict r = row, *restrict x0 = x + k, *restrict x1 = x0 + n;
        hsep_real *restrict x2 = x1 + n, *restrict x3 = x2 + n;
        if (k >= head) {
            const hsep_real a[4] = {-x0[0], -x1[0], -x2[0], -x3[0]};
            const hsep_real *const all[4] = {x0, x1, x2, x3};
            hsep_take_four(row, a, all, length);
        } else {
            const cholesky_reflection h = cholesky_reflect(row[0], x0, n, 4);
            const hsep_real v0 = h.v[0], v1 = h.v[1], v2 = h.v[2], v3 = h.v[3], tau = h.tau;
            for (hsep_int j = 1; j < length; j++) {
                const hsep_real w = tau * (r[j] + ((v0 * x0[j] + v1 * x1[j]) + (v2 * x2[j] + v3 * x3[j])));
                r[j] = w - r[j];
                x0[j] -= v0 * w, x1[j] -= v1 * w, x2[j] -= v2 * w, x3[j] -= v3 * w;
            }
            row[0] = h.norm;
        }
        row += length;
    }
}

/* Solve with count rows from the diagonal on for as many entries y, one after the other. */
static inline void cholesky_forward_rows(const hsep_real *const rows[], hsep_int count, hsep_real y[])
{
    if (count == 4) { /* of known length: registers */
        const hsep_real *r0 = rows[0], *r1 = rows[1], *r2 = rows[2];
        const hsep_real y0 = y[0] / r0[0], y1 = (y[1] - y0 * r0[1]) / r1[0];
        const hsep_real y2 = ((y[2] - y0 * r0[2]) - y1 * r1[1]) / r2[0];
        y[3] = (((y[3] - y0 * r0[3]) - y1 * r1[2]) - y2 * r2[1]) / rows[3][0];
        y[0] = y0, y[1] = y1, y[2] = y2;
        return;
    }
    for (hsep_int r = 0; r < count; r++) {
        y[r] /= rows[r][0];
        for (hsep_int j = 1; r + j < count; j++) {
            y[r + j] -= y[r] * rows[r][j];
        }
    }
}

HSEP_API void hsep_cholesky_forward(const hsep_real triangle[], hsep_int n, hsep_int count, hsep_real b[])
{
    const hsep_real *row = triangle;
    for (hsep_int first = 0; first < count; first += HSEP_CHOLESKY_PANEL) {
        const hsep_int height = hsep_min(count - first, HSEP_CHOLESKY_PANEL), upper = hsep_min(height, 4);
        const hsep_int after = n - first - height;
        const hsep_real *rows[HSEP_CHOLESKY_PANEL], *x[HSEP_CHOLESKY_PANEL];
        hsep_real *y = b + first;
        for (hsep_int r = 0; r < height; r++) {
            rows[r] = row;
            x[r] = row + (height - r); /* after the panel */
            row += n - first - r;
        }
        cholesky_forward_rows(rows, upper, y);
        if (height > 4) {
            const hsep_real *const of_lower[4] = {rows[0] + 4, rows[1] + 3, rows[2] + 2, rows[3] + 1};
            hsep_take_four(y + 4, y, of_lower, height - 4);
            cholesky_forward_rows(rows + 4, height - 4, y + 4);
        }
        if (height == HSEP_CHOLESKY_PANEL) {
            hsep_take_eight(y + height, y, x, after);
            continue;
        }
        for (hsep_int r = 0; r < height; r++) {
            hsep_axpy(y + height, -y[r], x[r], after);
        }
    }
}

HSEP_API void hsep_cholesky_backward(const hsep_real triangle[], hsep_int n, hsep_int count, hsep_real b[])
{
    const hsep_real *row = triangle + (hsep_int)(hsep_triangle(n) - hsep_triangle(n - count));
    hsep_int last = count;
    for (; last >= 4; last -= 4) { /* four rows share what follows them */
        const hsep_int beyond = n - last;
        const hsep_real *r3 = row - (beyond + 1), *r2 = r3 - (beyond + 2), *r1 = r2 - (beyond + 3);
        const hsep_real *r0 = r1 - (beyond + 4), *const x[4] = {r0 + 4, r1 + 3, r2 + 2, r3 + 1};
        hsep_real sums[4], *y = b + (last - 4);
        hsep_dot_four(b + last, x, count - last, sums);
        y[3] = (y[3] - sums[3]) / r3[0];
        y[2] = ((y[2] - sums[2]) - r2[1] * y[3]) / r2[0];
        y[1] = (((y[1] - sums[1]) - r1[1] * y[2]) - r1[2] * y[3]) / r1[0];
        y[0] = ((((y[0] - sums[0]) - r0[1] * y[1]) - r0[2] * y[2]) - r0[3] * y[3]) / r0[0];
        row = r0;
    }
    for (; last > 0; last--) {
        row -= n - last + 1;
        b[last - 1] = (b[last - 1] - hsep_dot(row + 1, b + last, count - last)) / row[0];
    }
}

HSEP_API void hsep_cholesky_solve(const hsep_real triangle[], hsep_int n, hsep_real b[])
{
    hsep_cholesky_forward(triangle, n, n, b);
    hsep_cholesky_backward(triangle, n, n, b);
}

#include "hsep_knots.h"

/* Cubic splines with knots 1, 2 and 4 spacings apart as sums of those 1 apart: the two-scale relation, once and twice.
 */
static const hsep_real knots_shares[] = {1.0,      0.125,   0.5,     0.75,     0.5,     0.125,  0.015625,
                                         0.0625,   0.15625, 0.3125,  0.484375, 0.625,   0.6875, 0.625,
                                         0.484375, 0.3125,  0.15625, 0.0625,   0.015625};
static const hsep_int knots_lengths[HSEP_KNOTS_LEVELS] = {1, 5, 13}, knots_places[HSEP_KNOTS_LEVELS] = {0, 1, 6};

HSEP_API hsep_knots hsep_knots_of(hsep_int n, hsep_int window)
{
    const hsep_int wide = window > 4 ? window : 4;
    hsep_knots knots = {.n = n, .end = n, .m = n, .count = {n}};
    hsep_int begin = 0;
    for (int level = 0; window > 0 && level < HSEP_KNOTS_LEVELS; level++) {
        const hsep_int apart = (hsep_int)1 << level, end = level < HSEP_KNOTS_LEVELS - 1 ? 2 * apart * wide : n;
        knots.begin[level] = begin;
        for (; begin < end && begin + knots_lengths[level] <= n; begin += apart) {}
        knots.count[level] = (begin - knots.begin[level]) / apart;
        begin -= 4 * apart; /* the next ones overlap */
    }
    knots.m = knots.count[0] + knots.count[1] + knots.count[2];
    knots.end = 0;
    for (hsep_int i = 0; i < knots.m; i++) {
        const hsep_knot knot = hsep_knots_at(&knots, i);
        knots.end = knot.begin + knot.length > knots.end ? knot.begin + knot.length : knots.end;
    }
    return knots;
}

HSEP_API hsep_knot hsep_knots_at(const hsep_knots *self, hsep_int i)
{
    int level = 0;
    hsep_int end = self->count[0];
    while (i >= end) {
        end += self->count[++level];
    }
    return (hsep_knot){
        .level = (hsep_int)level,
        .first = end - self->count[level],
        .last = end - 1,
        .begin = self->begin[level] + ((i + self->count[level] - end) << level),
        .length = knots_lengths[level],
        .share = knots_shares + knots_places[level]};
}

HSEP_API void hsep_knots_widen(const hsep_knots *self, const hsep_real x[], hsep_real c[])
{
    memset(c, 0, (size_t)self->n * sizeof(hsep_real));
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_knot knot = hsep_knots_at(self, i);
        hsep_axpy(c + knot.begin, x[i], knot.share, knot.length);
    }
}

HSEP_API void hsep_knots_narrow(const hsep_knots *self, const hsep_real g[], hsep_real h[])
{
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_knot knot = hsep_knots_at(self, i);
        hsep_real sum = 0.0;
        for (hsep_int j = 0; j < knot.length; j++) {
            sum += knot.share[j] * g[knot.begin + j];
        }
        h[i] += sum;
    }
}

HSEP_API void hsep_knots_add(const hsep_knots *self, const hsep_real products[], hsep_real triangle[], hsep_real work[])
{
    memset(work, 0, (size_t)(self->n + 2 * HSEP_KNOTS_NEAR) * sizeof(hsep_real));
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_knot row = hsep_knots_at(self, i);
        const hsep_int behind = row.begin + row.length + HSEP_KNOTS_NEAR;
        for (hsep_int k = 0; k < row.length; k++) { /* products of this spline with uniform ones */
            const hsep_real *of_uniform = products + HSEP_KNOTS_WIDTH * (row.begin + k);
            hsep_axpy(work + row.begin + k, row.share[k], of_uniform, HSEP_KNOTS_WIDTH);
        }
        for (hsep_int j = i; j < self->m; j++) {
            const hsep_knot column = hsep_knots_at(self, j);
            if (column.begin < behind) {
                const hsep_real *of_column = work + HSEP_KNOTS_NEAR + column.begin;
                triangle[j - i] += hsep_dot(column.share, of_column, column.length);
            } else {
                j = column.last;
            }
        }
        memset(work + row.begin, 0, (size_t)(row.length + 2 * HSEP_KNOTS_NEAR) * sizeof(hsep_real));
        triangle += self->m - i;
    }
}

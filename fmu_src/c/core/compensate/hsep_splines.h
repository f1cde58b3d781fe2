/* Cubic B-spline basis of the change of the command, delta(k) = sum_j c_j b(k - j spacing), over a plan.
 *
 * Spline j begins at sample j spacing and ends 4 spacings later; the last one ends so that the last four samples of a
 * plan are without change. Splines -3, -2, -1 began before the plan and still act in it. The drive limits the
 * differences of delta of orders 0 to 3. Each of them, as a share of its limit, is a "row": order o at sample k is row
 * o horizon + k.
 */
#ifndef HSEP_SPLINES_H
#define HSEP_SPLINES_H

#include "hsep_layout.h"
#include "hsep_plan_constants.h"

#define HSEP_ORDERS 4                          /* orders of difference: 0, the change itself, to 3, its jerk */
#define HSEP_SPLINES_TOGETHER (4 * HSEP_LANES) /* splines whose products with another one are summed side by side */

typedef struct {
    hsep_int horizon, spacing;
    hsep_int n;                        /* splines that begin in a plan */
    hsep_real share[HSEP_ORDERS];      /* 1 / limit of an order, 1/m */
    hsep_int shape;                    /* (4 spacing,) b */
    hsep_int differences[HSEP_ORDERS]; /* (4 spacing + 3,) of each order, in shares */
} hsep_splines;
HSEP_ASSERT_WORDS(hsep_splines, 12);

/* Differences of orders 0 to 3 at a sample with this value, from those at the sample before, in place. */
static inline void hsep_differ(hsep_real differences[HSEP_ORDERS], hsep_real value)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_real before = differences[order];
        differences[order] = value;
        value -= before;
    }
}

/* Differences at the last of three samples, from 0. */
static inline void hsep_differ_from(hsep_real differences[HSEP_ORDERS], const hsep_real before[3])
{
    hsep_zero(differences, HSEP_ORDERS);
    for (int i = 0; i < 3; i++) {
        hsep_differ(differences, before[i]);
    }
}

/* Splines that begin in a plan and end four samples before it does, or earlier. horizon >= 4 spacing + 3. */
static inline hsep_int hsep_splines_count(hsep_int horizon, hsep_int spacing)
{
    return (horizon - 4 * spacing - HSEP_SPLINES_END) / spacing + 1;
}

/* The spline itself, b, (4 spacing,). */
static inline const hsep_real *hsep_splines_shape(const hsep_splines *self) { return hsep_at_const(self, self->shape); }

/* Knots of the splines that a plan is solved for: sums of the uniform ones, which it changes the last plan by. In the
 * first two windows, in which a plan acts or is pinned next, these are uniform splines themselves; after them knots
 * are twice, and after four windows four times as far apart. What is planned there is planned again, with closer
 * knots, before it acts, and goes on as it is until then. A spline is a sum of those with half its knot interval. */
#define HSEP_KNOTS_LEVELS 3 /* of the distance between knots: 1, 2, 4 spacings */
#define HSEP_KNOTS_NEAR 5   /* uniform splines on each side whose rows overlap those of one, at most */
#define HSEP_KNOTS_WIDTH (2 * HSEP_KNOTS_NEAR + 1)

typedef struct {
    hsep_int n;                        /* uniform splines that may change, */
    hsep_int end;                      /* those before the last one that does, */
    hsep_int m;                        /* and splines that are solved for, */
    hsep_int count[HSEP_KNOTS_LEVELS]; /* of each level, */
    hsep_int begin[HSEP_KNOTS_LEVELS]; /* which begins with that uniform spline */
} hsep_knots;
HSEP_ASSERT_WORDS(hsep_knots, 9);

/* A spline that is solved for: share[i], i < length, of the uniform splines begin + i. */
typedef struct {
    hsep_int level, first, last; /* distance of knots, and the first and the last spline that have it */
    hsep_int begin, length;
    const hsep_real *share;
} hsep_knot;

/* The differences of an order of one spline, in shares, (4 spacing + order,); the first one is 0. */
static inline const hsep_real *splines_differences(const hsep_splines *self, unsigned order)
{
    return hsep_at_const(self, self->differences[order]);
}

static inline hsep_int splines_length(const hsep_splines *self, unsigned order) { return 4 * self->spacing + order; }

static inline hsep_real hsep_splines_lay_out(hsep_splines *self, hsep_int horizon, hsep_int spacing)
{
    hsep_real end = HSEP_WORDS(hsep_splines);
    self->horizon = horizon;
    self->spacing = spacing;
    self->n = hsep_splines_count(horizon, spacing);
    self->shape = hsep_take(&end, 4.0 * (hsep_real)spacing);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        self->differences[order] = hsep_take(&end, 4.0 * (hsep_real)spacing + 3.0);
    }
    return end * sizeof(hsep_real);
}

/* Another limit of an order from now on, m a sample to that power. */
static inline void hsep_splines_limit(hsep_splines *self, unsigned order, hsep_real limit)
{
    const hsep_int width = 4 * self->spacing;
    const hsep_real *b = hsep_splines_shape(self);
    hsep_real *e = hsep_at(self, self->differences[order]), now[HSEP_ORDERS] = {0.0};
    self->share[order] = 1.0 / limit;
    for (hsep_int k = 0; k < width + 3; k++) {
        hsep_differ(now, k < width ? b[k] : 0.0);
        e[k] = now[order] * self->share[order];
    }
}

/* Fill the block. limit: of the change, m, and of its differences of orders 1 to 3, m a sample to that power. */
static inline void hsep_splines_init(
    hsep_splines *self, hsep_int horizon, hsep_int spacing, const hsep_real limit[HSEP_ORDERS])
{
    (void)hsep_splines_lay_out(self, horizon, spacing);
    for (hsep_int k = 0; k < 4 * spacing; k++) { /* the uniform cubic B-spline on the knots 0, 1, 2, 3, 4 */
        const hsep_real at = (hsep_real)k / (hsep_real)spacing, u = at >= 2.0 ? 4.0 - at : at; /* it is symmetric */
        hsep_at(self, self->shape)[k] = u < 1.0 ? u * u * u / 6.0 : (((-3.0 * u + 12.0) * u - 12.0) * u + 4.0) / 6.0;
    }
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_splines_limit(self, order, limit[order]);
    }
}

/* Sum of the first count splines at sample k, with coefficients c, (count,), from spline -3 on. */
static inline hsep_real hsep_splines_sum(const hsep_splines *self, const hsep_real c[], hsep_int count, hsep_int k)
{
    const hsep_int knot = k / self->spacing;
    const hsep_real *b = hsep_splines_shape(self) + k % self->spacing;
    hsep_real sum = 0.0;
    for (hsep_int i = 0; i <= HSEP_N_DECIDED && knot + i < count; i++) {
        sum += c[knot + i] * b[(HSEP_N_DECIDED - i) * self->spacing];
    }
    return sum;
}

/* Rows, (4 samples,), of a change by c, (count,): of spline first - 3, whose last part acts, and those after it. */
static inline void hsep_splines_rows(
    const hsep_splines *self, const hsep_real c[], hsep_int count, hsep_int first, hsep_int samples, hsep_real rows[])
{
    const hsep_int spacing = self->spacing;
    const hsep_real s0 = self->share[0], s1 = self->share[1], s2 = self->share[2], s3 = self->share[3];
    hsep_real *r1 = rows + samples, *r2 = r1 + samples, *r3 = r2 + samples, last = 0.0, last_1 = 0.0, last_2 = 0.0;
    for (hsep_int k = 0, knot = 0; k < samples; knot++) { /* four splines act from one knot to the next */
        const hsep_real *b = hsep_splines_shape(self);
        hsep_real a[HSEP_N_DECIDED + 1];
        for (hsep_int i = 0; i <= HSEP_N_DECIDED; i++) {
            a[i] = knot >= first && knot - first + i < count ? c[knot - first + i] : 0.0;
        }
        for (const hsep_int end = hsep_min(k + spacing, samples); k < end; k++, b++) {
            const hsep_real d = ((a[0] * b[3 * spacing] + a[1] * b[2 * spacing]) + a[2] * b[spacing]) + a[3] * b[0];
            const hsep_real d_1 = d - last, d_2 = d_1 - last_1;
            rows[k] = d * s0, r1[k] = d_1 * s1, r2[k] = d_2 * s2, r3[k] = (d_2 - last_2) * s3;
            last = d, last_1 = d_1, last_2 = d_2;
        }
    }
}

/* Rows of orders 1 to 3 of x_d, (count,) m, where one within the length of a spline exceeds its limit, 0 elsewhere; 4
 * count rows. before: (3,) m, the commands before it. */
static inline void hsep_splines_exceeded(
    const hsep_splines *self, const hsep_real x_d[], const hsep_real before[3], hsep_int count, hsep_real rows[])
{
    const hsep_int near = 4 * self->spacing;
    hsep_real now[HSEP_ORDERS];
    hsep_zero(rows, count);
    hsep_differ_from(now, before);
    for (hsep_int k = 0; k < count; k++) {
        hsep_differ(now, x_d[k]);
        for (unsigned order = 1; order < HSEP_ORDERS; order++) {
            rows[order * count + k] = now[order] * self->share[order];
        }
    }
    for (unsigned order = 1; order < HSEP_ORDERS; order++) {
        hsep_real *row = rows + order * count;
        hsep_int end = 0; /* of those that exceed it so far */
        for (hsep_int k = 0; k < count + near; k++) {
            end = k < count && hsep_fabs(row[k]) > HSEP_LIMITS_EXCEEDED ? k + 1 : end;
            if (k >= near && (end == 0 || end + 2 * near <= k)) {
                row[k - near] = 0.0;
            }
        }
    }
}

/* g, (n - first,), += A' rows, A being the matrix of hsep_splines_rows. The rows are used up. */
static inline void hsep_splines_transpose(const hsep_splines *self, hsep_real rows[], hsep_int first, hsep_real g[])
{
    const hsep_real *b = hsep_splines_shape(self);
    const hsep_int horizon = self->horizon, spacing = self->spacing;
    const hsep_real s0 = self->share[0], s1 = self->share[1], s2 = self->share[2], s3 = self->share[3];
    const hsep_real *r1 = rows + horizon, *r2 = rows + 2 * horizon, *r3 = rows + 3 * horizon;
    /* A' = B' (s_0 + D' (s_1 + D' (s_2 + D' s_3))) with the differences D: what later samples say comes first. */
    const hsep_int begin = first * spacing + 1, end = self->n * spacing + 3 * spacing; /* of the change itself */
    const hsep_real a3 = s3 * r3[end + 2], b3 = s3 * r3[end + 1], a2 = s2 * r2[end + 1] + (b3 - a3);
    hsep_real u3 = s3 * r3[end], u2 = s2 * r2[end] + (u3 - b3), u1 = s1 * r1[end] + (u2 - a2);
    for (hsep_int k = end; k-- > begin;) {
        const hsep_real v3 = s3 * r3[k], v2 = s2 * r2[k] + (v3 - u3), v1 = s1 * r1[k] + (v2 - u2);
        rows[k] = s0 * rows[k] + (v1 - u1);
        u1 = v1, u2 = v2, u3 = v3;
    }
    for (hsep_int j = first; j < self->n; j++) {
        g[j - first] += hsep_dot(b + 1, rows + j * spacing + 1, 4 * spacing - 1);
    }
}

/* sums, (HSEP_SPLINES_TOGETHER,): products of splines i, i + 1, ..., each with the one d later; of sorted weights. */
static inline void splines_products(
    const hsep_splines *self, const hsep_real sorted[], hsep_int i, hsep_int d, hsep_real sums[])
{
    const hsep_int spacing = self->spacing;
    hsep_lanes s0 = {0.0}, s1 = s0, s2 = s0, s3 = s0; /* each has a name, and so a register */
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_real *before = splines_differences(self, order), *e = before + d * spacing;
        const hsep_real *of_phase = sorted + order * self->horizon + i + d;
        const hsep_int length = splines_length(self, order), count = length > d * spacing ? length - d * spacing : 0;
        for (hsep_int phase = 0; phase < spacing; phase++) {
            const hsep_real *weight = of_phase + (phase == 0); /* the first difference is 0 */
            for (hsep_int k = phase == 0 ? spacing : phase; k < count; k += spacing, weight++) {
                const hsep_real product = e[k] * before[k];
                const hsep_lanes *w = hsep_lanes_const(weight);
                s0 += product * w[0], s1 += product * w[1], s2 += product * w[2], s3 += product * w[3];
            }
            of_phase += (self->horizon - phase - 1) / spacing + 1;
        }
    }
    hsep_lanes *to = hsep_lanes_at(sums);
    to[0] = s0, to[1] = s1, to[2] = s2, to[3] = s3;
}

/* The products A' diag(weights) A (hsep_knots_add). work: (4 horizon + 4 HSEP_LANES_MOST,), of which the last ones are
 * read beside others. */
static inline void hsep_splines_gram(
    const hsep_splines *self, const hsep_real weights[], hsep_int first, hsep_real products[], hsep_real work[])
{
    const hsep_int n = self->n - first;
    hsep_real sums[HSEP_SPLINES_TOGETHER], *sorted = work; /* rows that are spacing apart become neighbours */
    for (unsigned order = 0; order < HSEP_ORDERS; order++, weights += self->horizon) {
        for (hsep_int phase = 0; phase < self->spacing; phase++) {
            for (hsep_int k = phase; k < self->horizon; k += self->spacing) {
                *sorted++ = weights[k];
            }
        }
    }
    hsep_zero(products, HSEP_KNOTS_WIDTH * n);
    for (hsep_int d = 0; d < n && d * self->spacing + 1 < splines_length(self, HSEP_ORDERS - 1); d++) {
        for (hsep_int i = 0; i + d < n; i++) {
            const hsep_int within = i % HSEP_SPLINES_TOGETHER;
            if (within == 0) {
                splines_products(self, work, first + i, d, sums);
            }
            products[HSEP_KNOTS_WIDTH * i + HSEP_KNOTS_NEAR + d] = sums[within];
            products[HSEP_KNOTS_WIDTH * (i + d) + HSEP_KNOTS_NEAR - d] = sums[within];
        }
    }
}

/* The sum of squares of a uniform spline's rows: the largest entry on the diagonal of A' A. */
static inline hsep_real hsep_splines_energy(const hsep_splines *self)
{
    hsep_real sum = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_real *e = splines_differences(self, order);
        sum += hsep_dot(e, e, splines_length(self, order));
    }
    return sum;
}

/* The triangle of n rows := W' W of the filtered splines, W's columns being the filtered spline, (horizon,),
 * each shifted by one spacing more. Each diagonal is a running sum. */
static inline void hsep_splines_filtered_gram(
    const hsep_splines *self, const hsep_real filtered[], hsep_real triangle[])
{
    const hsep_int n = self->n, spacing = self->spacing;
    for (hsep_int d = 0; d < n; d++) {
        /* Columns j - d and j: sum over u of s(u + d spacing) s(u), up to where column j is cut off */
        hsep_real sum = 0.0;
        hsep_int u = 0;
        for (hsep_int j = n; j-- > d;) { /* rows 0 ... i - 1 have n, n - 1, ... entries */
            for (; u + j * spacing < self->horizon; u++) {
                sum += filtered[u + d * spacing] * filtered[u];
            }
            const hsep_int i = j - d;
            triangle[i * n - i * (i - 1) / 2 + d] = sum;
        }
    }
}

/* Cubic splines with knots 1, 2 and 4 spacings apart as sums of those 1 apart: the two-scale relation. */
static const hsep_real knots_shares[] = {1.0,      0.125,   0.5,     0.75,     0.5,     0.125,  0.015625,
                                         0.0625,   0.15625, 0.3125,  0.484375, 0.625,   0.6875, 0.625,
                                         0.484375, 0.3125,  0.15625, 0.0625,   0.015625};
static const hsep_int knots_places[HSEP_KNOTS_LEVELS] = {0, 1, 6};
static inline hsep_int knots_length(int level) { return ((hsep_int)4 << level) - 3; }

static inline hsep_knot hsep_knots_at(const hsep_knots *self, hsep_int i)
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
        .length = knots_length(level),
        .share = knots_shares + knots_places[level]};
}

/* n uniform splines, and how many of them begin in a window; 0: each is solved for. */
static inline hsep_knots hsep_knots_of(hsep_int n, hsep_int window)
{
    const hsep_int wide = window > 4 ? window : 4;
    hsep_knots knots = {.n = n, .count = {n}};
    hsep_int begin = 0;
    for (int level = 0; window > 0 && level < HSEP_KNOTS_LEVELS; level++) {
        const hsep_int apart = (hsep_int)1 << level, end = level < HSEP_KNOTS_LEVELS - 1 ? 2 * apart * wide : n;
        knots.begin[level] = begin;
        for (; begin < end && begin + knots_length(level) <= n; begin += apart) {}
        knots.count[level] = (begin - knots.begin[level]) / apart;
        begin -= 4 * apart; /* the next ones overlap */
    }
    knots.m = knots.count[0] + knots.count[1] + knots.count[2];
    const hsep_knot last = hsep_knots_at(&knots, knots.m - 1);
    knots.end = last.begin + last.length;
    return knots;
}

/* c, (n,), of the uniform splines := x, (m,). */
static inline void hsep_knots_widen(const hsep_knots *self, const hsep_real x[], hsep_real c[])
{
    hsep_zero(c, self->n);
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_knot knot = hsep_knots_at(self, i);
        for (hsep_int j = 0; j < knot.length; j++) {
            c[knot.begin + j] += x[i] * knot.share[j];
        }
    }
}

/* Rows of a change by the splines x, (m,), m. c: work, (3 + n,). */
static inline void hsep_knots_rows(
    const hsep_knots *self, const hsep_splines *splines, const hsep_real x[], hsep_real c[], hsep_real rows[])
{
    hsep_zero(c, HSEP_N_DECIDED);
    hsep_knots_widen(self, x, c + HSEP_N_DECIDED);
    hsep_splines_rows(splines, c, HSEP_N_DECIDED + self->n, splines->n - self->n, splines->horizon, rows);
}

/* h, (m,), += the transpose of hsep_knots_widen of g, (n,). */
static inline void hsep_knots_narrow(const hsep_knots *self, const hsep_real g[], hsep_real h[])
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

/* The triangle of m rows += a symmetric product of the uniform splines, products[HSEP_KNOTS_WIDTH i + HSEP_KNOTS_NEAR +
 * d] of spline i with i + d. work: (n + 2 HSEP_KNOTS_NEAR,). */
static inline void hsep_knots_add(
    const hsep_knots *self, const hsep_real products[], hsep_real triangle[], hsep_real work[])
{
    hsep_zero(work, self->n + 2 * HSEP_KNOTS_NEAR);
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_knot row = hsep_knots_at(self, i);
        const hsep_int after = row.begin + row.length + HSEP_KNOTS_NEAR;
        for (hsep_int k = 0; k < row.length; k++) { /* products of this spline with uniform ones */
            const hsep_real *of_uniform = products + HSEP_KNOTS_WIDTH * (row.begin + k);
            hsep_axpy(work + row.begin + k, row.share[k], of_uniform, HSEP_KNOTS_WIDTH);
        }
        for (hsep_int j = i; j < self->m; j++) {
            const hsep_knot column = hsep_knots_at(self, j);
            if (column.begin < after) {
                const hsep_real *of_column = work + HSEP_KNOTS_NEAR + column.begin;
                triangle[j - i] += hsep_dot(column.share, of_column, column.length);
            } else {
                j = column.last;
            }
        }
        hsep_zero(work + row.begin, row.length + 2 * HSEP_KNOTS_NEAR);
        triangle += self->m - i;
    }
}

#endif

/* Primal-dual interior-point solver for a bounded plan: Mehrotra's predictor-corrector method (1992), half
 * a step a call:
 *  min 1/2 x' P x - v' x  with  low <= A x <= high, A being hsep_splines_rows of hsep_knots_widen.
 *
 * An iterate stays inside the bounds once a full step has reached them. What is found after fewer steps may exceed
 * them: the iterate that was farthest inside is kept beside it.
 */
#ifndef HSEP_INTERIOR_H
#define HSEP_INTERIOR_H

#include "hsep_splines.h"
#include "hsep_cholesky.h"

/* Where the solver ends. */
typedef struct {
    hsep_real mu;            /* complementarity mu at the end, as a share of the cost per bound */
    hsep_real dual_residual; /* dual residual at the end, as a share of its largest term */
    hsep_real margin;        /* shares by which its bounds are tighter, and may be exceeded at the end */
    hsep_int steps;          /* at most */
    hsep_real first_mu;      /* mu at the beginning, as that at the end */
} hsep_tolerance;

typedef struct {
    hsep_tolerance tolerance;
    hsep_knots knots; /* of x, (m,); the splines before them are fixed */
    hsep_int steps;   /* done for this plan */
    hsep_int half;    /* whether half of another one is */
    hsep_int solved;  /* whether x is the solution */
    hsep_real mu;     /* m2, at x */
    hsep_real cost;   /* m2, scale of the cost per bound */
    hsep_real rho;    /* 1/m2, proximal regularisation of the multipliers */
    hsep_real beyond; /* shares, by how much inner exceeds the worst bound; the margin: there is none */
    /* followed by arrays, see interior_lay_out */
} hsep_interior;
HSEP_ASSERT_WORDS(hsep_interior, 21);

/* The problem, of which v, low and high are set before hsep_interior_begin, and the arrays of the solver; of the first
 * three the first n entries count. Slacks and multipliers are of the bounds B x >= b, of the low rows, then of the high
 * ones, as qp.py has them: B = [A; -A], b = [low; -high]. A proximal term rho regularises the multipliers:
 * ds = B dx + r_p + rho dz, z ds + s dz = r_c (s + rho z). */
typedef struct {
    const hsep_splines *splines;
    const hsep_knots *knots;
    hsep_int first;        /* spline that is not fixed */
    hsep_int n, m;         /* entries of x, as many as there are knots; bounds, an even number */
    hsep_real *v, *x;      /* m; m, result, from 0 */
    hsep_real *inner;      /* m, the iterate farthest inside the bounds without their margin, if one is */
    hsep_real *r_d, *dx;   /* (n,) dual residual v - P x + B' z, and step */
    hsep_real *low, *high; /* (4 horizon,) in shares, before the beginning; then rows of x or dx, or for A', and work */
    hsep_real *b, *s, *z;  /* (m,) shares; slack s = B x - b and multiplier z, m2, both > 0 */
    hsep_real *inverse;    /* (m,) 1 / (s + rho z) */
    hsep_real *r_c, *r_p;  /* (m,) complementarity that a step aims at, times inverse; primal residual B x - b - s */
    hsep_real *ds, *dz;    /* (m,) B x or B dx, then the step of s; the step of z */
    hsep_real *factor;     /* triangle of n rows; work, as are the next ones outside of a step: */
    hsep_real *c;          /* (all + 2 HSEP_KNOTS_NEAR,), all splines, */
    hsep_real *products;   /* (all, HSEP_KNOTS_WIDTH) products of splines */
    hsep_real rho;         /* 1/m2, proximal regularisation of the multipliers */
    struct {
        hsep_int begin, count;
    } range[HSEP_ORDERS]; /* the rows of an order that x touches */
} hsep_problem;

/* The vector of an array of the slacks `it` at bound r. */
#define AT(array) (*hsep_lanes_at(it.array + r))

/* to := [low; -high] of rows, which are B x where both are A x. */
static void interior_take_rows(hsep_problem it, const hsep_real *low, const hsep_real *high, hsep_real *to)
{
    hsep_real *second = to + it.m / 2;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_int begin = it.range[order].begin, count = it.range[order].count;
        hsep_copy(to, low + begin, count);
        for (hsep_int r = 0; r < count; r++) {
            second[r] = -high[begin + r];
        }
        to += count, second += count;
    }
}

/* Rows := y of the low bounds + sign y of the high ones. */
static void interior_give_rows(hsep_problem it, const hsep_real *y, hsep_real sign)
{
    const hsep_real *high = y + it.m / 2;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_real *rows = it.low + it.range[order].begin;
        const hsep_int count = it.range[order].count;
        hsep_copy(rows, y, count);
        hsep_axpy(rows, sign, high, count);
        y += count, high += count;
    }
}

/* Steps of B dx in ds, ds = B dx + r_p + rho dz and dz = r_c - z (B dx + r_p) / (s + rho z), and their lengths to where
 * all values + length change stay >= 0: the largest -change / value is its inverse. */
static void interior_step(hsep_problem it, hsep_real *alpha_p, hsep_real *alpha_d)
{
    const hsep_real rho = it.rho;
    hsep_lanes primal = {0.0}, dual = primal;
    for (hsep_int r = 0; r < it.m; r += HSEP_LANES) {
        const hsep_lanes z = AT(z), to = AT(ds) + AT(r_p), dz = AT(r_c) - z * AT(inverse) * to, ds = to + rho * dz;
        AT(dz) = dz;
        AT(ds) = ds;
        primal = hsep_larger(-ds / AT(s), primal);
        dual = hsep_larger(-dz / z, dual);
    }
    const hsep_real of_s = hsep_largest(primal), of_z = hsep_largest(dual);
    *alpha_p = of_s > 1.0 ? 1.0 / of_s : 1.0;
    *alpha_d = of_z > 1.0 ? 1.0 / of_z : 1.0;
}

/* mu after the predictor's step, as far as s and z stay >= 0. */
static hsep_real interior_predicted(hsep_problem it)
{
    hsep_real alpha_p, alpha_d, sum = 0.0, other = 0.0; /* two side by side, whatever a vector holds */
    interior_step(it, &alpha_p, &alpha_d);
    for (hsep_int r = 0; r < it.m; r += 2) {
        sum += (it.s[r] + alpha_p * it.ds[r]) * (it.z[r] + alpha_d * it.dz[r]);
        other += (it.s[r + 1] + alpha_p * it.ds[r + 1]) * (it.z[r + 1] + alpha_d * it.dz[r + 1]);
    }
    return (sum + other) / (hsep_real)it.m;
}

/* Go by the corrector's step, as far as s and z stay > 0; return the primal length. */
static hsep_real interior_move(hsep_problem it)
{
    hsep_real alpha_p, alpha_d;
    interior_step(it, &alpha_p, &alpha_d);
    const hsep_real primal = alpha_p >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha_p;
    const hsep_real dual = alpha_d >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha_d, rho = it.rho;
    for (hsep_int r = 0; r < it.m; r += HSEP_LANES) {
        const hsep_lanes s = AT(s) + primal * AT(ds), z = AT(z) + dual * AT(dz);
        AT(s) = s;
        AT(z) = z;
        AT(inverse) = (hsep_real)1.0 / (s + rho * z);
    }
    return primal;
}

/* Walk the arrays of n splines; return the bytes of the block. block: NULL where only its size is asked for. */
static hsep_real interior_lay_out(hsep_real *block, hsep_int horizon, hsep_int n, hsep_problem *it)
{
    const hsep_real columns = (hsep_real)n, rows = HSEP_ORDERS * (hsep_real)horizon, work = rows + 4 * HSEP_LANES_MOST;
    const hsep_real others[] = {
        rows, work, hsep_triangle(n), columns + 2.0 * HSEP_KNOTS_NEAR, HSEP_KNOTS_WIDTH * columns};
    hsep_real **const arrays[] = {&it->x,  &it->v,   &it->inner,   &it->r_d,    &it->dx,  &it->b,
                                  &it->s,  &it->z,   &it->inverse, &it->r_c,    &it->r_p, &it->ds,
                                  &it->dz, &it->low, &it->high,    &it->factor, &it->c,   &it->products};
    hsep_real end = HSEP_WORDS(hsep_interior);
    for (int i = 0; i < 18; i++) {
        const hsep_int offset = hsep_take(&end, i < 5 ? columns : i < 13 ? 2.0 * rows : others[i - 13]);
        *arrays[i] = block != NULL ? block + offset : NULL;
    }
    return end * sizeof(hsep_real);
}

/* bytes of the block, counted as a number */
static hsep_real hsep_interior_size(hsep_int horizon, hsep_int n)
{
    hsep_problem arrays;
    return interior_lay_out(NULL, horizon, n, &arrays);
}

static hsep_problem hsep_interior_problem(hsep_interior *self, const hsep_splines *splines)
{
    hsep_problem it = {
        .splines = splines,
        .knots = &self->knots,
        .first = splines->n - self->knots.n,
        .n = self->knots.m,
        .rho = self->rho};
    (void)interior_lay_out((hsep_real *)self, splines->horizon, splines->n, &it);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_int begin = it.first * splines->spacing + 1; /* a spline begins with 0 */
        it.range[order].begin = begin + order * splines->horizon;
        it.range[order].count = (it.first + it.knots->end + 3) * splines->spacing + order - begin;
        it.m += 2 * it.range[order].count;
    }
    return it;
}

/* B of x or dx, (n,), to ds. */
static void interior_rows(hsep_problem it, const hsep_real x[])
{
    hsep_knots_rows(it.knots, it.splines, x, it.c, it.low);
    interior_take_rows(it, it.low, it.low, it.ds);
}

/* g, (n,), += A' of the rows. */
static void interior_transpose(hsep_problem it, hsep_real g[])
{
    hsep_zero(it.c, it.knots->n);
    hsep_splines_transpose(it.splines, it.low, it.first, it.c);
    hsep_knots_narrow(it.knots, it.c, g);
}

/* r_d := v - P x + B' z; return its largest entry as a share of the largest one of its terms. */
static hsep_real interior_dual_residual(hsep_problem it, const hsep_real *P)
{
    hsep_real residual = 0.0, largest = 0.0;
    hsep_copy(it.r_d, it.v, it.n);
    for (hsep_int i = 0; i < it.n; i++) { /* v - P x */
        const hsep_int left = it.n - i - 1;
        it.r_d[i] -= hsep_dot(P, it.x + i, left + 1);
        hsep_axpy(it.r_d + i + 1, -it.x[i], P + 1, left);
        P += left + 1;
    }
    hsep_zero(it.dx, it.n);
    interior_give_rows(it, it.z, -1.0);
    interior_transpose(it, it.dx);
    for (hsep_int j = 0; j < it.n; j++) {
        largest = hsep_fmax(
            hsep_fmax(largest, hsep_fabs(it.v[j])), hsep_fmax(hsep_fabs(it.v[j] - it.r_d[j]), hsep_fabs(it.dx[j])));
        it.r_d[j] += it.dx[j];
        residual = hsep_fmax(residual, hsep_fabs(it.r_d[j]));
    }
    return residual / largest;
}

/* dx := (P + A' W A)^-1 (r_d + B' (r_c - z r_p / (s + rho z))), and B dx. */
static void interior_direction(hsep_problem it)
{
    for (hsep_int r = 0; r < it.m; r += HSEP_LANES) {
        AT(ds) = AT(r_c) - AT(z) * AT(inverse) * AT(r_p);
    }
    interior_give_rows(it, it.ds, -1.0);
    hsep_copy(it.dx, it.r_d, it.n);
    interior_transpose(it, it.dx);
    hsep_cholesky_solve(it.factor, it.n, it.dx);
    interior_rows(it, it.dx);
}

/* The residuals at x, and whether it is the solution; the predictor's r_c, as if s z = 0 could be reached at once. */
static void interior_residuals(hsep_interior *self, hsep_problem it, const hsep_real P[])
{
    hsep_lanes largest = {0.0}, outside = largest - HSEP_HUGE(1e300);
    interior_rows(it, it.x);
    for (hsep_int r = 0; r < it.m; r += HSEP_LANES) {
        const hsep_lanes s = AT(s), distance = AT(ds) - AT(b), r_p = distance - s;
        AT(r_p) = r_p;
        AT(r_c) = -(s * AT(z) * AT(inverse));
        largest = hsep_larger(hsep_larger(r_p, -r_p), largest);
        outside = hsep_larger(-distance, outside);
    }
    const hsep_real beyond = hsep_largest(outside); /* negative inside all bounds */
    if (beyond < self->beyond) {
        self->beyond = beyond;
        hsep_copy(it.inner, it.x, it.n);
    }
    const hsep_real mu = self->mu = hsep_dot(it.s, it.z, it.m) / (hsep_real)it.m, r_d = interior_dual_residual(it, P);
    self->solved = self->steps == self->tolerance.steps || mu == 0.0 || /* it underflows */
                   (mu < self->tolerance.mu * self->cost && hsep_largest(largest) < self->tolerance.margin &&
                    r_d < self->tolerance.dual_residual);
}

/* Begin within the bounds as they are, from 0. knots: of the last splines; P: a triangle of n rows; cost: scale, m2. */
static void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const hsep_knots *knots, const hsep_real P[], hsep_real cost,
    const hsep_tolerance *tolerance)
{
    self->knots = *knots;
    self->tolerance = *tolerance;
    self->steps = self->half = 0;
    hsep_problem it = hsep_interior_problem(self, splines);
    self->cost = cost / (hsep_real)it.m;
    self->beyond = tolerance->margin;
    /* The proximal term bounds A' W A by P / HSEP_QP_REGULARISATION: where active bounds hardly differ, rounding in it
     * would outgrow P. That of a uniform spline: wide ones have up to four times as much. */
    hsep_real largest = 0.0;
    for (hsep_int i = 0, diagonal = 0; i < it.n; diagonal += it.n - i++) {
        largest = hsep_fmax(largest, P[diagonal]);
    }
    it.rho = self->rho = HSEP_QP_REGULARISATION * hsep_splines_energy(splines) / largest;
    interior_take_rows(it, it.low, it.high, it.b);
    hsep_zero(it.x, it.n);
    for (hsep_int r = 0; r < it.m; r++) {
        it.s[r] = hsep_fmax(-it.b[r], HSEP_QP_FIRST_SLACK);
        it.z[r] = self->tolerance.first_mu * self->cost / it.s[r];
        it.inverse[r] = 1.0 / (it.s[r] + it.rho * it.z[r]);
    }
    interior_residuals(self, it, P);
}

/* The factor of P + A' W A, in place of P; return whether there is none. */
static int interior_factor(hsep_problem it, const hsep_real P[])
{
    hsep_copy(it.factor, P, (hsep_int)hsep_triangle(it.n));
    for (hsep_int r = 0; r < it.m; r += HSEP_LANES) { /* the weights W */
        AT(ds) = AT(z) * AT(inverse);
    }
    interior_give_rows(it, it.ds, 1.0);
    hsep_splines_gram(it.splines, it.low, it.first, it.products, it.high);
    hsep_knots_add(it.knots, it.products, it.factor, it.c);
    return !hsep_cholesky_rows(it.factor, it.n, 0, it.n, NULL);
}

/* Do half a step: its factor and its predictor, or its corrector and the residuals at its end. P: as in
 * hsep_interior_begin. Returns whether the plan is solved. */
static int hsep_interior_advance(hsep_interior *self, const hsep_splines *splines, const hsep_real P[])
{
    const hsep_problem it = hsep_interior_problem(self, splines);
    self->half = !self->half;
    if (self->half) { /* Newton: P dx - B' dz = r_d,  ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z) */
        if (self->solved || interior_factor(it, P)) {
            return 1;
        }
        interior_direction(it);
        const hsep_real mu = self->mu, ratio = interior_predicted(it) / mu; /* mu_aff / mu; sigma = ratio^3 */
        const hsep_real centre = hsep_fmax(mu * ratio * ratio * ratio, 0.1 * self->tolerance.mu * self->cost);
        for (hsep_int r = 0; r < it.m; r += HSEP_LANES) { /* with the curvature ds dz that the predictor shows */
            AT(r_c) = (centre - AT(s) * AT(z) - AT(ds) * AT(dz)) * AT(inverse);
        }
        return 0;
    }
    interior_direction(it);
    hsep_axpy(it.x, interior_move(it), it.dx, it.n);
    self->steps++;
    interior_residuals(self, it, P);
    return (int)self->solved;
}

#endif

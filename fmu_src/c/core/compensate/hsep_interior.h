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

/* Where the problem goes before hsep_interior_begin; of v, x and inner the first m entries count. */
typedef struct {
    hsep_real *v;          /* (n,) m */
    hsep_real *x;          /* (n,) m, start and result */
    hsep_real *inner;      /* (n,) m, result: the iterate farthest inside the bounds without their margin, or NULL */
    hsep_real *low, *high; /* (4 preview,), in shares */
    hsep_real *c;          /* (n + 2 HSEP_KNOTS_NEAR,) work, before and behind it, */
    hsep_real *products;   /* (n, HSEP_KNOTS_WIDTH) for products of splines, */
    hsep_real *factor;     /* and for a triangle of n rows */
} hsep_problem;

/* Slacks and multipliers of the bounds B x >= b, of the low rows, then of the high ones, as qp.py has them:
 * B = [A; -A], b = [low; -high]. A proximal term rho regularises the multipliers: ds = B dx + r_p + rho dz,
 * z ds + s dz = r_c (s + rho z). */
typedef struct {
    hsep_real rho;          /* 1/m2, proximal regularisation of the multipliers */
    hsep_int n;             /* bounds, an even number */
    hsep_real *rows, *work; /* (4 preview,) low and high before the beginning; then rows of x or dx, or for A' */
    hsep_real *b, *s, *z;   /* (n,) shares; slack s = B x - b and multiplier z, m2, both > 0 */
    hsep_real *inverse;     /* (n,) 1 / (s + rho z) */
    hsep_real *r_c, *r_p;   /* (n,) complementarity that a step aims at, times inverse; primal residual B x - b - s */
    hsep_real *ds, *dz;     /* (n,) B x or B dx, then the step of s; the step of z */
    struct {
        hsep_int begin, count;
    } range[HSEP_ORDERS]; /* the rows of an order that x touches */
} slacks;

/* Lengths of a step, 0 ... 1. */
typedef struct {
    hsep_real primal, dual;
} slacks_step_lengths;

/* The vector of an array of the slacks `it` at bound r. */
#define AT(array) (*hsep_lanes_at(it.array + r))

/* to := [low; -high] of rows, which are B x where both are A x. */
static void slacks_take_rows(const slacks *self, const hsep_real *low, const hsep_real *high, hsep_real *to)
{
    hsep_real *second = to + self->n / 2;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_int begin = self->range[order].begin, count = self->range[order].count;
        hsep_copy(to, low + begin, count);
        for (hsep_int r = 0; r < count; r++) {
            second[r] = -high[begin + r];
        }
        to += count, second += count;
    }
}

/* Rows := y of the low bounds + sign y of the high ones. */
static void slacks_give_rows(const slacks *self, const hsep_real *y, hsep_real sign)
{
    const hsep_real *high = y + self->n / 2;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_real *rows = self->rows + self->range[order].begin;
        const hsep_int count = self->range[order].count;
        hsep_copy(rows, y, count);
        hsep_axpy(rows, sign, high, count);
        y += count, high += count;
    }
}

/* Steps of B dx in ds, ds = B dx + r_p + rho dz and dz = r_c - z (B dx + r_p) / (s + rho z), and their lengths to where
 * all values + length change stay >= 0: the largest -change / value is its inverse. */
static slacks_step_lengths slacks_lengths(const slacks *self)
{
    const slacks it = *self;
    const hsep_real rho = it.rho;
    hsep_lanes primal = {0.0}, dual = primal;
    for (hsep_int r = 0; r < it.n; r += HSEP_LANES) {
        const hsep_lanes z = AT(z), to = AT(ds) + AT(r_p), dz = AT(r_c) - z * AT(inverse) * to, ds = to + rho * dz;
        AT(dz) = dz;
        AT(ds) = ds;
        primal = hsep_larger(-ds / AT(s), primal);
        dual = hsep_larger(-dz / z, dual);
    }
    const hsep_real of_s = hsep_largest(primal), of_z = hsep_largest(dual);
    return (slacks_step_lengths){.primal = of_s > 1.0 ? 1.0 / of_s : 1.0, .dual = of_z > 1.0 ? 1.0 / of_z : 1.0};
}

/* mu after the predictor's step, as far as s and z stay >= 0. */
static hsep_real slacks_predicted(const slacks *self)
{
    const slacks_step_lengths alpha = slacks_lengths(self);
    const slacks it = *self;
    hsep_real sums[2] = {0.0, 0.0}; /* two side by side, whatever a vector holds */
    for (hsep_int r = 0; r < it.n; r++) {
        sums[r % 2] += (it.s[r] + alpha.primal * it.ds[r]) * (it.z[r] + alpha.dual * it.dz[r]);
    }
    return (sums[0] + sums[1]) / (hsep_real)it.n;
}

/* Go by the corrector's step, as far as s and z stay > 0; return the primal length. */
static hsep_real slacks_move(const slacks *self)
{
    const slacks_step_lengths alpha = slacks_lengths(self);
    const hsep_real primal = alpha.primal >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.primal;
    const hsep_real dual = alpha.dual >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.dual;
    const slacks it = *self;
    const hsep_real rho = it.rho;
    for (hsep_int r = 0; r < it.n; r += HSEP_LANES) {
        const hsep_lanes s = AT(s) + primal * AT(ds), z = AT(z) + dual * AT(dz);
        AT(s) = s;
        AT(z) = z;
        AT(inverse) = (hsep_real)1.0 / (s + rho * z);
    }
    return primal;
}

/* The arrays after the struct. */
typedef struct {
    const hsep_splines *splines;
    const hsep_knots *knots;
    hsep_int first, n; /* the first spline that is not fixed; entries of x, as many as there are knots */
    hsep_problem problem;
    hsep_real *r_d, *dx; /* (n,) dual residual v - P x + B' z, and step */
    slacks slacks;
} interior_arrays;

/* Take count numbers of a block; NULL if there is no block but only its size is asked for. */
static hsep_real *interior_take(hsep_real *block, hsep_real *end, hsep_real count)
{
    const hsep_int offset = hsep_take(end, count);
    return block != NULL ? block + offset : NULL;
}

/* Walk the arrays of n splines; return the bytes of the block. */
static hsep_real interior_lay_out(hsep_real *block, hsep_int preview, hsep_int n, interior_arrays *a)
{
    const hsep_real columns = (hsep_real)n, rows = HSEP_ORDERS * (hsep_real)preview;
    hsep_real end = HSEP_WORDS(hsep_interior);
    hsep_real **const of_columns[5] = {&a->problem.x, &a->problem.v, &a->problem.inner, &a->r_d, &a->dx};
    for (int i = 0; i < 5; i++) {
        *of_columns[i] = interior_take(block, &end, columns);
    }
    slacks *bounds = &a->slacks;
    a->problem.low = bounds->rows = interior_take(block, &end, rows);
    a->problem.high = bounds->work = interior_take(block, &end, rows + 4 * HSEP_LANES_MOST);
    hsep_real **const of_bounds[8] = {&bounds->b,   &bounds->s,   &bounds->z,  &bounds->inverse,
                                      &bounds->r_c, &bounds->r_p, &bounds->ds, &bounds->dz};
    for (int i = 0; i < 8; i++) {
        *of_bounds[i] = interior_take(block, &end, 2.0 * rows);
    }
    a->problem.factor = interior_take(block, &end, hsep_triangle(n));
    a->problem.c = interior_take(block, &end, columns + 2.0 * HSEP_KNOTS_NEAR);
    a->problem.products = interior_take(block, &end, HSEP_KNOTS_WIDTH * columns);
    return end * sizeof(hsep_real);
}

/* bytes of the block, counted as a number */
static hsep_real hsep_interior_size(hsep_int preview, hsep_int n)
{
    interior_arrays arrays;
    return interior_lay_out(NULL, preview, n, &arrays);
}

static interior_arrays interior_open(hsep_interior *self, const hsep_splines *splines)
{
    interior_arrays a;
    (void)interior_lay_out((hsep_real *)self, splines->preview, splines->n, &a);
    a.splines = splines;
    a.knots = &self->knots;
    a.first = splines->n - self->knots.n;
    a.n = self->knots.m;
    a.slacks.rho = self->rho;
    a.slacks.n = 0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_int begin = a.first * splines->spacing + 1; /* a spline begins with 0 */
        a.slacks.range[order].begin = begin + order * splines->preview;
        a.slacks.range[order].count = (a.first + a.knots->end + 3) * splines->spacing + order - begin;
        a.slacks.n += 2 * a.slacks.range[order].count;
    }
    return a;
}

/* B of x or dx, (n,), to ds. */
static void interior_rows(const interior_arrays *a, const hsep_real x[])
{
    hsep_knots_widen(a->knots, x, a->problem.c);
    hsep_splines_rows(a->splines, a->problem.c, a->first, a->slacks.rows);
    slacks_take_rows(&a->slacks, a->slacks.rows, a->slacks.rows, a->slacks.ds);
}

/* g, (n,), += A' of the rows. */
static void interior_transpose(const interior_arrays *a, hsep_real g[])
{
    hsep_zero(a->problem.c, a->knots->n);
    hsep_splines_transpose(a->splines, a->slacks.rows, a->first, a->problem.c);
    hsep_knots_narrow(a->knots, a->problem.c, g);
}

static hsep_problem hsep_interior_problem(hsep_interior *self, const hsep_splines *splines)
{
    hsep_problem problem = interior_open(self, splines).problem;
    problem.inner = self->beyond < self->tolerance.margin ? problem.inner : NULL;
    return problem;
}

/* r_d := v - P x + B' z; return its largest entry as a share of the largest one of its terms. */
static hsep_real interior_dual_residual(const interior_arrays *a, const hsep_real *P)
{
    hsep_real residual = 0.0, largest = 0.0;
    hsep_copy(a->r_d, a->problem.v, a->n);
    for (hsep_int i = 0; i < a->n; i++) { /* v - P x */
        const hsep_int left = a->n - i - 1;
        a->r_d[i] -= hsep_dot(P, a->problem.x + i, left + 1);
        hsep_axpy(a->r_d + i + 1, -a->problem.x[i], P + 1, left);
        P += left + 1;
    }
    hsep_zero(a->dx, a->n);
    slacks_give_rows(&a->slacks, a->slacks.z, -1.0);
    interior_transpose(a, a->dx);
    for (hsep_int j = 0; j < a->n; j++) {
        largest = hsep_fmax(
            hsep_fmax(largest, hsep_fabs(a->problem.v[j])),
            hsep_fmax(hsep_fabs(a->problem.v[j] - a->r_d[j]), hsep_fabs(a->dx[j])));
        a->r_d[j] += a->dx[j];
        residual = hsep_fmax(residual, hsep_fabs(a->r_d[j]));
    }
    return residual / largest;
}

/* dx := (P + A' W A)^-1 (r_d + B' (r_c - z r_p / (s + rho z))), and B dx. */
static void interior_direction(const interior_arrays *a)
{
    const slacks it = a->slacks;
    for (hsep_int r = 0; r < it.n; r += HSEP_LANES) {
        AT(ds) = AT(r_c) - AT(z) * AT(inverse) * AT(r_p);
    }
    slacks_give_rows(&it, it.ds, -1.0);
    hsep_copy(a->dx, a->r_d, a->n);
    interior_transpose(a, a->dx);
    hsep_cholesky_solve(a->problem.factor, a->n, a->dx);
    interior_rows(a, a->dx);
}

/* The residuals at x, and whether it is the solution; the predictor's r_c, as if s z = 0 could be reached at once. */
static void interior_residuals(hsep_interior *self, const interior_arrays *a, const hsep_real P[])
{
    const slacks it = a->slacks;
    hsep_lanes largest = {0.0}, outside = largest - HSEP_HUGE(1e300);
    interior_rows(a, a->problem.x);
    for (hsep_int r = 0; r < it.n; r += HSEP_LANES) {
        const hsep_lanes s = AT(s), distance = AT(ds) - AT(b), r_p = distance - s;
        AT(r_p) = r_p;
        AT(r_c) = -(s * AT(z) * AT(inverse));
        largest = hsep_larger(hsep_larger(r_p, -r_p), largest);
        outside = hsep_larger(-distance, outside);
    }
    const hsep_real beyond = hsep_largest(outside); /* negative inside all bounds */
    if (beyond < self->beyond) {
        self->beyond = beyond;
        hsep_copy(a->problem.inner, a->problem.x, a->n);
    }
    const hsep_real mu = self->mu = hsep_dot(it.s, it.z, it.n) / (hsep_real)it.n, r_d = interior_dual_residual(a, P);
    self->solved = self->steps == self->tolerance.steps || mu == 0.0 || /* it underflows */
                   (mu < self->tolerance.mu * self->cost && hsep_largest(largest) < self->tolerance.margin &&
                    r_d < self->tolerance.dual_residual);
}

/* Begin with x and the bounds as they are. knots: of the last splines; P: a triangle of m rows; cost: its scale, m2. */
static void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const hsep_knots *knots, const hsep_real P[], hsep_real cost,
    const hsep_tolerance *tolerance)
{
    self->knots = *knots;
    self->tolerance = *tolerance;
    self->steps = self->half = 0;
    interior_arrays a = interior_open(self, splines);
    self->cost = cost / (hsep_real)a.slacks.n;
    self->beyond = tolerance->margin;
    /* The proximal term bounds A' W A by P / HSEP_QP_REGULARISATION: where active bounds hardly differ, rounding in it
     * would outgrow P. That of a uniform spline: wide ones have up to four times as much. */
    hsep_real largest = 0.0;
    for (hsep_int i = 0, diagonal = 0; i < a.n; diagonal += a.n - i++) {
        largest = hsep_fmax(largest, P[diagonal]);
    }
    a.slacks.rho = self->rho = HSEP_QP_REGULARISATION * hsep_splines_energy(splines) / largest;
    slacks_take_rows(&a.slacks, a.slacks.rows, a.slacks.work, a.slacks.b);
    interior_rows(&a, a.problem.x);
    const slacks it = a.slacks;
    for (hsep_int r = 0; r < it.n; r++) {
        it.s[r] = hsep_fmax(it.ds[r] - it.b[r], HSEP_QP_FIRST_SLACK);
        it.z[r] = self->tolerance.first_mu * self->cost / it.s[r];
        it.inverse[r] = 1.0 / (it.s[r] + it.rho * it.z[r]);
    }
    interior_residuals(self, &a, P);
}

/* The factor of P + A' W A, in place of P; return whether there is none. */
static int interior_factor(const interior_arrays *a, const hsep_real P[])
{
    const slacks it = a->slacks;
    hsep_copy(a->problem.factor, P, (hsep_int)hsep_triangle(a->n));
    for (hsep_int r = 0; r < it.n; r += HSEP_LANES) { /* the weights W */
        AT(ds) = AT(z) * AT(inverse);
    }
    slacks_give_rows(&it, it.ds, 1.0);
    hsep_splines_gram(a->splines, a->slacks.rows, a->first, a->problem.products, a->slacks.work);
    hsep_knots_add(a->knots, a->problem.products, a->problem.factor, a->problem.c);
    return !hsep_cholesky_rows(a->problem.factor, a->n, 0, a->n, NULL);
}

/* Do half a step: its factor and its predictor, or its corrector and the residuals at its end. P: as in
 * hsep_interior_begin. Returns whether the plan is solved. */
static int hsep_interior_advance(hsep_interior *self, const hsep_splines *splines, const hsep_real P[])
{
    const interior_arrays a = interior_open(self, splines);
    const slacks it = a.slacks;
    self->half = !self->half;
    if (self->half) { /* Newton: P dx - B' dz = r_d,  ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z) */
        if (self->solved || interior_factor(&a, P)) {
            return 1;
        }
        interior_direction(&a);
        const hsep_real mu = self->mu, ratio = slacks_predicted(&it) / mu; /* mu_aff / mu; sigma = ratio^3 */
        const hsep_real centre = hsep_fmax(mu * ratio * ratio * ratio, 0.1 * self->tolerance.mu * self->cost);
        for (hsep_int r = 0; r < it.n; r += HSEP_LANES) { /* with the curvature ds dz that the predictor shows */
            AT(r_c) = (centre - AT(s) * AT(z) - AT(ds) * AT(dz)) * AT(inverse);
        }
        return 0;
    }
    interior_direction(&a);
    hsep_axpy(a.problem.x, slacks_move(&it), a.dx, a.n);
    self->steps++;
    interior_residuals(self, &a, P);
    return (int)self->solved;
}

#endif

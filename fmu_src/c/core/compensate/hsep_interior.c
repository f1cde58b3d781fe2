#include "hsep_interior.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"
#include "hsep_slacks.h"
#include "hsep_vector.h"

#include <stddef.h>
#include <string.h>

/* The arrays behind the struct. */
typedef struct {
    hsep_int n;          /* entries of x */
    hsep_real *x, *v;    /* (n,) iterate and linear term */
    hsep_real *inner;    /* (n,) iterate that is farthest inside the bounds */
    hsep_real *r_d, *dx; /* (n,) dual residual v - P x + B' z, and step */
    hsep_real *factor;   /* triangle of n rows */
    hsep_slacks slacks;
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
    a->x = interior_take(block, &end, columns);
    a->v = interior_take(block, &end, columns);
    a->inner = interior_take(block, &end, columns);
    a->r_d = interior_take(block, &end, columns);
    a->dx = interior_take(block, &end, columns);
    a->slacks.Ax = interior_take(block, &end, rows);
    a->slacks.Adx = interior_take(block, &end, rows);
    a->slacks.work = interior_take(block, &end, rows);
    for (int i = 0; i < 2; i++) {
        hsep_side *side = &a->slacks.side[i];
        side->b = interior_take(block, &end, rows);
        side->s = interior_take(block, &end, rows);
        side->z = interior_take(block, &end, rows);
        side->inverse = interior_take(block, &end, rows);
        side->r_c = interior_take(block, &end, rows);
        side->r_p = interior_take(block, &end, rows);
        side->ds = interior_take(block, &end, rows);
        side->dz = interior_take(block, &end, rows);
    }
    a->factor = interior_take(block, &end, hsep_triangle(n));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_interior_size(hsep_int preview, hsep_int n)
{
    interior_arrays arrays;
    return interior_lay_out(NULL, preview, n, &arrays);
}

static interior_arrays interior_open(hsep_interior *self, const hsep_splines *splines)
{
    interior_arrays a;
    (void)interior_lay_out((hsep_real *)self, splines->preview, splines->n, &a);
    a.n = splines->n - self->first;
    a.slacks.rho = self->rho;
    a.slacks.sides = self->sides;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_int begin, end;
        hsep_splines_touched(splines, self->first, order, &begin, &end);
        a.slacks.range[order].begin = begin + order * splines->preview;
        a.slacks.range[order].end = end + order * splines->preview;
    }
    return a;
}

HSEP_API hsep_problem hsep_interior_problem(hsep_interior *self, const hsep_splines *splines)
{
    const interior_arrays a = interior_open(self, splines);
    return (hsep_problem){
        .v = a.v,
        .x = a.x,
        .inner = self->beyond < self->tolerance.margin ? a.inner : NULL,
        .low = a.slacks.side[0].b,
        .high = a.slacks.side[1].b};
}

/* The rows of P, a triangle, from the first free spline. */
static const hsep_real *interior_free_rows(const hsep_interior *self, const hsep_splines *splines, const hsep_real P[])
{
    return P + (self->first * splines->n - self->first * (self->first - 1) / 2);
}

/* The proximal term that bounds A' W A by P / HSEP_QP_REGULARISATION: where active bounds hardly differ, rounding
 * in it would outgrow P. */
static hsep_real interior_proximal(const hsep_splines *splines, const hsep_real *P, hsep_int n)
{
    hsep_real largest = 0.0;
    for (hsep_int i = 0; i < n; i++) {
        largest = hsep_fmax(largest, P[0]);
        P += n - i;
    }
    return HSEP_QP_REGULARISATION * hsep_splines_energy(splines) / largest;
}

/* Start at x, with or without the multipliers that are there. */
static void interior_start(
    hsep_interior *self, const hsep_splines *splines, const hsep_real P[], const hsep_tolerance *tolerance, int again)
{
    interior_arrays a = interior_open(self, splines);
    self->tolerance = *tolerance;
    self->steps = self->part = 0;
    a.slacks.rho = self->rho = interior_proximal(splines, interior_free_rows(self, splines, P), a.n);
    hsep_splines_rows(splines, a.x, self->first, a.slacks.Ax);
    hsep_slacks_begin(&a.slacks, self->cost, again);
}

HSEP_API void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const hsep_real P[], hsep_int first, hsep_real cost,
    const hsep_tolerance *tolerance)
{
    self->first = first;
    self->sides = 0.0;
    const interior_arrays a = interior_open(self, splines);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        self->sides += 2.0 * (hsep_real)(a.slacks.range[order].end - a.slacks.range[order].begin);
    }
    self->cost = cost / self->sides;
    self->beyond = tolerance->margin;
    interior_start(self, splines, P, tolerance, 0);
}

HSEP_API void hsep_interior_again(
    hsep_interior *self, const hsep_splines *splines, const hsep_real P[], const hsep_tolerance *tolerance)
{
    interior_start(self, splines, P, tolerance, 1);
}

/* r_d := v - P x, P being the triangle of the splines first ... n - 1. */
static void interior_gradient(const interior_arrays *a, const hsep_real *P)
{
    memcpy(a->r_d, a->v, (size_t)a->n * sizeof(hsep_real));
    for (hsep_int i = 0; i < a->n; i++) {
        const hsep_int left = a->n - i - 1;
        a->r_d[i] -= hsep_dot(P, a->x + i, left + 1);
        hsep_axpy(a->r_d + i + 1, -a->x[i], P + 1, left);
        P += a->n - i;
    }
}

/* r_d := v - P x + B' z, the rows of B' z being in work; return its largest entry as a share of the largest one of its
 * terms. */
static hsep_real interior_dual_residual(
    const interior_arrays *a, const hsep_splines *splines, hsep_int first, const hsep_real *P)
{
    hsep_real residual = 0.0, largest = 0.0;
    interior_gradient(a, P);
    memset(a->dx, 0, (size_t)a->n * sizeof(hsep_real));
    hsep_splines_transpose(splines, a->slacks.work, first, a->dx);
    for (hsep_int j = 0; j < a->n; j++) {
        largest = hsep_fmax(
            hsep_fmax(largest, hsep_fabs(a->v[j])), hsep_fmax(hsep_fabs(a->v[j] - a->r_d[j]), hsep_fabs(a->dx[j])));
        a->r_d[j] += a->dx[j];
        residual = hsep_fmax(residual, hsep_fabs(a->r_d[j]));
    }
    return residual / largest;
}

/* dx := (P + A' W A)^-1 (r_d + A' push), and what it does to the rows. */
static void interior_direction(const interior_arrays *a, const hsep_splines *splines, hsep_int first)
{
    hsep_slacks_push(&a->slacks);
    memcpy(a->dx, a->r_d, (size_t)a->n * sizeof(hsep_real));
    hsep_splines_transpose(splines, a->slacks.work, first, a->dx);
    hsep_cholesky_solve(a->factor, a->n, a->dx);
    hsep_splines_rows(splines, a->dx, first, a->slacks.Adx);
}

/* Begin a step with its residuals; return whether there is none, as the plan is solved. */
static int interior_residuals(
    hsep_interior *self, const interior_arrays *a, const hsep_splines *splines, const hsep_real P[])
{
    hsep_real r_p, beyond;
    hsep_splines_rows(splines, a->x, self->first, a->slacks.Ax);
    const hsep_real mu = hsep_slacks_residuals(&a->slacks, &r_p, &beyond);
    if (beyond < self->beyond) {
        self->beyond = beyond;
        memcpy(a->inner, a->x, (size_t)a->n * sizeof(hsep_real));
    }
    const hsep_real r_d = interior_dual_residual(a, splines, self->first, P);
    if (self->steps == self->tolerance.steps || mu == 0.0 || /* it underflows */
        (mu < self->tolerance.mu * self->cost && r_p < self->tolerance.margin && r_d < self->tolerance.dual_residual)) {
        return 1;
    }
    self->steps++;
    self->mu = mu;
    return 0;
}

/* The first or the second half of the factor of P + A' W A; return whether there is none. Work, not rows, is halved. */
static int interior_factor(
    const hsep_interior *self, const interior_arrays *a, const hsep_splines *splines, const hsep_real P[], int second)
{
    const hsep_int half = a->n / 6 / HSEP_CHOLESKY_PANEL * HSEP_CHOLESKY_PANEL;
    if (second) {
        return !hsep_cholesky_rows(a->factor, a->n, half, a->n, NULL);
    }
    memcpy(a->factor, P, (size_t)hsep_triangle(a->n) * sizeof(hsep_real));
    hsep_splines_gram(splines, a->slacks.Adx, self->first, a->factor, a->slacks.work);
    return !hsep_cholesky_rows(a->factor, a->n, 0, half, NULL);
}

HSEP_API int hsep_interior_advance(hsep_interior *self, const hsep_splines *splines, const hsep_real P[])
{
    const interior_arrays a = interior_open(self, splines);
    const hsep_int part = self->part;
    P = interior_free_rows(self, splines, P);
    self->part = (part + 1) % HSEP_INTERIOR_PARTS;
    if (part < HSEP_INTERIOR_PARTS - 1) {
        return part == 0 ? interior_residuals(self, &a, splines, P) : interior_factor(self, &a, splines, P, part == 2);
    }
    /* Newton: P dx - B' dz = r_d,  ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z) */
    interior_direction(&a, splines, self->first);
    const hsep_real mu = self->mu, ratio = hsep_slacks_predicted(&a.slacks) / mu; /* mu_aff / mu; sigma = ratio^3 */
    hsep_slacks_correct(&a.slacks, hsep_fmax(mu * ratio * ratio * ratio, 0.1 * self->tolerance.mu * self->cost));
    interior_direction(&a, splines, self->first);
    const hsep_real alpha = hsep_slacks_move(&a.slacks);
    for (hsep_int j = 0; j < a.n; j++) {
        a.x[j] += alpha * a.dx[j];
    }
    return 0;
}

#include "hsep_interior.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>
#include <string.h>

/* Slacks and multipliers of the bounds  low <= A x <= high, row by row. Side 0 are the lower bounds, B x >= b with
 * B = A and b = low, side 1 the upper ones, B = -A and b = -high. A proximal term rho regularises the multipliers:
 * ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z). */

/* One side of the bounds, all (4 preview,): slack s = B x - b and multiplier z, both > 0. */
typedef struct {
    hsep_real *b;       /* low or high */
    hsep_real *s, *z;   /* shares; m2 */
    hsep_real *inverse; /* 1 / (s + rho z) */
    hsep_real *r_c;     /* complementarity that a step aims at, times inverse */
    hsep_real *r_p;     /* primal residual B x - b - s */
    hsep_real *ds, *dz; /* steps of s and z, once their lengths are known */
} slacks_side;

typedef struct {
    hsep_real rho;       /* 1/m2, proximal regularisation of the multipliers */
    hsep_real sides;     /* number of bounds, low and high ones */
    hsep_real *Ax, *Adx; /* rows of the iterate and of its step */
    hsep_real *work;     /* a row's value of both sides together */
    slacks_side side[2]; /* low and high */
    struct {
        hsep_int begin, end;
    } range[HSEP_ORDERS]; /* the rows of an order that x touches, begin ... end - 1 */
} slacks;

/* Lengths of a step, 0 ... 1. */
typedef struct {
    hsep_real primal, dual;
} slacks_step_lengths;

/* Of the sides: B = A, B = -A. */
static const hsep_real slacks_sign[2] = {1.0, -1.0};

/* Begin with Ax and the bounds as they are. cost: m2, of the beginning, for each of the bounds. */
static void slacks_begin(const slacks *self, hsep_real cost)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const slacks_side *side = &self->side[i];
                side->s[r] = hsep_fmax(slacks_sign[i] * (self->Ax[r] - side->b[r]), HSEP_QP_FIRST_SLACK);
                side->z[r] = HSEP_QP_FIRST_MU * cost / side->s[r];
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
}

/* Sums or maxima of rows, four side by side, and of the rows left over, so that compilers find vectors and results are
 * the same to the last bit whatever they find. */
typedef struct {
    hsep_real of[5];
} slacks_values;

static hsep_real slacks_sum(const slacks_values *values)
{
    const hsep_real *s = values->of;
    return ((s[0] + s[1]) + (s[2] + s[3])) + s[4];
}

static hsep_real slacks_larger(hsep_real a, hsep_real b) { return a > b ? a : b; }

static hsep_real slacks_largest(const slacks_values *values)
{
    hsep_real largest = values->of[4];
    for (int i = 0; i < 4; i++) {
        largest = slacks_larger(values->of[i], largest);
    }
    return largest;
}

/* work := B' sides of r_c - z r_p / (s + rho z), what the bounds add to the dual residual on the right-hand side. */
static void slacks_push(const slacks *self)
{
    const slacks_side *low = &self->side[0], *high = &self->side[1];
    hsep_real *restrict work = self->work;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
            work[r] = (low->r_c[r] - low->z[r] * low->inverse[r] * low->r_p[r]) -
                      (high->r_c[r] - high->z[r] * high->inverse[r] * high->r_p[r]);
        }
    }
}

/* Steps of count rows, ds = B dx + r_p + rho dz, dz = r_c - z (B dx + r_p) / (s + rho z), and the largest -change /
 * value of slacks and multipliers. */
static inline void slacks_steps(
    const slacks *self, int i, hsep_int r, hsep_int count, slacks_values *primal, slacks_values *dual)
{
    const slacks_side *side = &self->side[i];
    const hsep_real *restrict Adx = self->Adx + r, *restrict r_p = side->r_p + r, *restrict r_c = side->r_c + r;
    const hsep_real *restrict s = side->s + r, *restrict z = side->z + r, *restrict inverse = side->inverse + r;
    hsep_real *restrict ds = side->ds + r, *restrict dz = side->dz + r;
    for (hsep_int l = 0; l < count; l++) {
        const hsep_int at = count == 4 ? l : 4;
        const hsep_real to = slacks_sign[i] * Adx[l] + r_p[l];
        dz[l] = r_c[l] - z[l] * inverse[l] * to;
        ds[l] = to + self->rho * dz[l];
        primal->of[at] = slacks_larger(-ds[l] / s[l], primal->of[at]);
        dual->of[at] = slacks_larger(-dz[l] / z[l], dual->of[at]);
    }
}

/* Steps ds and dz, and their lengths to where all values + length change stay >= 0: the largest -change / value is its
 * inverse. */
static slacks_step_lengths slacks_lengths(const slacks *self)
{
    slacks_values primal = {{0.0}}, dual = {{0.0}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_steps(self, i, r, 4, &primal, &dual);
            }
            slacks_steps(self, i, r, self->range[order].end - r, &primal, &dual);
        }
    }
    const hsep_real of_s = slacks_largest(&primal), of_z = slacks_largest(&dual);
    return (slacks_step_lengths){.primal = of_s > 1.0 ? 1.0 / of_s : 1.0, .dual = of_z > 1.0 ? 1.0 / of_z : 1.0};
}

/* Residuals of count rows: the sum of s z, the largest primal residual, and the bound that is exceeded most. */
static inline void slacks_residuals(
    const slacks *self, int i, hsep_int r, hsep_int count, slacks_values *sum, slacks_values *largest,
    slacks_values *outside)
{
    const slacks_side *side = &self->side[i];
    const hsep_real *restrict Ax = self->Ax + r, *restrict b = side->b + r, *restrict s = side->s + r;
    const hsep_real *restrict z = side->z + r, *restrict inverse = side->inverse + r;
    hsep_real *restrict r_p = side->r_p + r, *restrict r_c = side->r_c + r;
    hsep_real *restrict Adx = self->Adx + r, *restrict work = self->work + r;
    for (hsep_int l = 0; l < count; l++) {
        const hsep_int at = count == 4 ? l : 4;
        const hsep_real product = s[l] * z[l], weight = z[l] * inverse[l], distance = slacks_sign[i] * (Ax[l] - b[l]);
        r_p[l] = distance - s[l];
        r_c[l] = -product * inverse[l];
        sum->of[at] += product;
        largest->of[at] = slacks_larger(slacks_larger(r_p[l], -r_p[l]), largest->of[at]);
        outside->of[at] = slacks_larger(-distance, outside->of[at]);
        Adx[l] = i == 0 ? weight : Adx[l] + weight;
        work[l] = i == 0 ? z[l] : work[l] - z[l];
    }
}

/* Return mu, the mean of s z; *primal: the largest primal residual; *beyond: by how much the worst bound is exceeded,
 * negative inside all of them. The weights of A' W A go to Adx, z's difference of
 * the sides to work, and the predictor's r_c is set, as if s z = 0 could be reached at once. */
static hsep_real slacks_take_residuals(const slacks *self, hsep_real *primal, hsep_real *beyond)
{
    slacks_values sum = {{0.0}}, largest = {{0.0}};
    slacks_values outside = {{-INFINITY, -INFINITY, -INFINITY, -INFINITY, -INFINITY}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_residuals(self, i, r, 4, &sum, &largest, &outside);
            }
            slacks_residuals(self, i, r, self->range[order].end - r, &sum, &largest, &outside);
        }
    }
    *primal = slacks_largest(&largest);
    *beyond = slacks_largest(&outside);
    return slacks_sum(&sum) / self->sides;
}

/* Sum of s z of count rows after a step. */
static inline void slacks_after(
    const slacks_side *side, const slacks_step_lengths *alpha, hsep_int r, hsep_int count, slacks_values *sum)
{
    for (hsep_int l = 0; l < count; l++) {
        sum->of[count == 4 ? l : 4] +=
            (side->s[r + l] + alpha->primal * side->ds[r + l]) * (side->z[r + l] + alpha->dual * side->dz[r + l]);
    }
}

/* mu after the predictor's step, as far as s and z stay >= 0. */
static hsep_real slacks_predicted(const slacks *self)
{
    const slacks_step_lengths alpha = slacks_lengths(self);
    slacks_values sum = {{0.0}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_after(&self->side[i], &alpha, r, 4, &sum);
            }
            slacks_after(&self->side[i], &alpha, r, self->range[order].end - r, &sum);
        }
    }
    return slacks_sum(&sum) / self->sides;
}

/* The corrector's r_c: the centre sigma mu, with the curvature ds dz that the predictor shows. */
static void slacks_correct(const slacks *self, hsep_real sigma_mu)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const slacks_side *side = &self->side[i];
            hsep_real *restrict r_c = side->r_c;
            for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
                r_c[r] = (sigma_mu - side->s[r] * side->z[r] - side->ds[r] * side->dz[r]) * side->inverse[r];
            }
        }
    }
}

/* Go by the corrector's step, as far as s and z stay > 0; return the primal length. */
static hsep_real slacks_move(const slacks *self)
{
    const slacks_step_lengths alpha = slacks_lengths(self);
    const hsep_real primal = alpha.primal >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.primal;
    const hsep_real dual = alpha.dual >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.dual;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const slacks_side *side = &self->side[i];
            hsep_real *restrict s = side->s, *restrict z = side->z, *restrict inverse = side->inverse;
            for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
                s[r] += primal * side->ds[r];
                z[r] += dual * side->dz[r];
                inverse[r] = 1.0 / (s[r] + self->rho * z[r]);
            }
        }
    }
    return primal;
}

/* The arrays behind the struct. */
typedef struct {
    hsep_int n;          /* entries of x */
    hsep_real *x, *v;    /* (n,) iterate and linear term */
    hsep_real *inner;    /* (n,) iterate that is farthest inside the bounds */
    hsep_real *r_d, *dx; /* (n,) dual residual v - P x + B' z, and step */
    hsep_real *factor;   /* triangle of n rows */
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
    hsep_real **const of_columns[5] = {&a->x, &a->v, &a->inner, &a->r_d, &a->dx};
    for (int i = 0; i < 5; i++) {
        *of_columns[i] = interior_take(block, &end, columns);
    }
    a->slacks.Ax = interior_take(block, &end, rows);
    a->slacks.Adx = interior_take(block, &end, rows);
    a->slacks.work = interior_take(block, &end, rows);
    for (int i = 0; i < 2; i++) {
        slacks_side *side = &a->slacks.side[i];
        hsep_real **const of_rows[8] = {&side->b,   &side->s,   &side->z,  &side->inverse,
                                        &side->r_c, &side->r_p, &side->ds, &side->dz};
        for (int j = 0; j < 8; j++) {
            *of_rows[j] = interior_take(block, &end, rows);
        }
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
    a.slacks.sides = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_int begin = self->first * splines->spacing + 1; /* a spline begins with 0 */
        const hsep_int end = (splines->n + 3) * splines->spacing + order;
        a.slacks.range[order].begin = begin + order * splines->preview;
        a.slacks.range[order].end = end + order * splines->preview;
        a.slacks.sides += 2.0 * (hsep_real)(end - begin);
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

HSEP_API void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const hsep_real P[], hsep_int first, hsep_real cost,
    const hsep_tolerance *tolerance)
{
    self->first = first;
    self->tolerance = *tolerance;
    self->steps = self->part = 0;
    interior_arrays a = interior_open(self, splines);
    self->cost = cost / a.slacks.sides;
    self->beyond = tolerance->margin;
    /* The proximal term bounds A' W A by P / HSEP_QP_REGULARISATION: where active bounds hardly differ, rounding in it
     * would outgrow P. */
    hsep_real largest = 0.0;
    for (hsep_int i = 0; i < a.n; i++) {
        largest = hsep_fmax(largest, P[0]);
        P += a.n - i;
    }
    a.slacks.rho = self->rho = HSEP_QP_REGULARISATION * hsep_splines_energy(splines) / largest;
    hsep_splines_rows(splines, a.x, first, a.slacks.Ax);
    slacks_begin(&a.slacks, self->cost);
}

/* r_d := v - P x + B' z, the rows of B' z being in work; return its largest entry as a share of the largest one of its
 * terms. */
static hsep_real interior_dual_residual(
    const interior_arrays *a, const hsep_splines *splines, hsep_int first, const hsep_real *P)
{
    hsep_real residual = 0.0, largest = 0.0;
    memcpy(a->r_d, a->v, (size_t)a->n * sizeof(hsep_real));
    for (hsep_int i = 0; i < a->n; i++) { /* v - P x */
        const hsep_int left = a->n - i - 1;
        a->r_d[i] -= hsep_dot(P, a->x + i, left + 1);
        hsep_axpy(a->r_d + i + 1, -a->x[i], P + 1, left);
        P += left + 1;
    }
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
    slacks_push(&a->slacks);
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
    const hsep_real mu = slacks_take_residuals(&a->slacks, &r_p, &beyond);
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
    self->part = (part + 1) % HSEP_INTERIOR_PARTS;
    if (part < HSEP_INTERIOR_PARTS - 1) {
        return part == 0 ? interior_residuals(self, &a, splines, P) : interior_factor(self, &a, splines, P, part == 2);
    }
    /* Newton: P dx - B' dz = r_d,  ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z) */
    interior_direction(&a, splines, self->first);
    const hsep_real mu = self->mu, ratio = slacks_predicted(&a.slacks) / mu; /* mu_aff / mu; sigma = ratio^3 */
    slacks_correct(&a.slacks, hsep_fmax(mu * ratio * ratio * ratio, 0.1 * self->tolerance.mu * self->cost));
    interior_direction(&a, splines, self->first);
    const hsep_real alpha = slacks_move(&a.slacks);
    for (hsep_int j = 0; j < a.n; j++) {
        a.x[j] += alpha * a.dx[j];
    }
    return 0;
}

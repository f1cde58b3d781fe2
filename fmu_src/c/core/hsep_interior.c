#include "hsep_interior.h"

#include "hsep_cholesky.h"

#include <math.h>
#include <string.h>

static const double interior_gap = 1e-15;            /* complementarity mu at the end, as a share of the cost */
static const double interior_dual = 1e-9;            /* dual residual at the end, as a share of its largest term */
static const double interior_first_slack = 0.3;      /* least distance from a bound to begin with */
static const double interior_first_gap = 10.0;       /* mu to begin with, as a share of the cost */
static const double interior_regularisation = 1e-14; /* proximal term of z, relative to rows and P */
static const double interior_way = 0.995;            /* share tau of the way to the nearest bound that a step goes */

/* One side of the bounds, B x >= b: slack s = B x - b, multiplier z, both > 0. */
typedef struct {
    double *s, *z;
    double *inverse; /* 1 / (s + rho z) */
    double *aim;     /* z ds + s dz of the step, times inverse */
    double *off;     /* primal residual B x - b - s */
} interior_side;

/* The arrays behind the struct. */
typedef struct {
    uint64_t n; /* entries of x */
    double rho;
    double *x, *v, *force, *dx;
    double *bound[2];       /* low and high */
    double *values, *along; /* A x and A dx */
    double *rows;           /* work */
    interior_side side[2];
    double *triangle;
} interior_arrays;

HSEP_API double hsep_interior_size(uint64_t preview, uint64_t n)
{
    const double rows = HSEP_ORDERS * (double)preview, x = (double)n;
    return (double)sizeof(hsep_interior) + (4.0 * x + 15.0 * rows + 0.5 * x * (x + 1.0)) * (double)sizeof(double);
}

static interior_arrays interior_open(hsep_interior *self, const hsep_splines *splines)
{
    const uint64_t n = splines->n, rows = HSEP_ORDERS * splines->preview;
    interior_arrays a;
    double *at = (double *)(self + 1);
    a.n = n - self->first;
    a.rho = self->rho;
    a.x = at, at += n;
    a.v = at, at += n;
    a.force = at, at += n;
    a.dx = at, at += n;
    a.values = at, at += rows;
    a.along = at, at += rows;
    a.rows = at, at += rows;
    for (int i = 0; i < 2; i++) {
        a.bound[i] = at, at += rows;
        a.side[i].s = at, at += rows;
        a.side[i].z = at, at += rows;
        a.side[i].inverse = at, at += rows;
        a.side[i].aim = at, at += rows;
        a.side[i].off = at, at += rows;
    }
    a.triangle = at;
    return a;
}

HSEP_API double *hsep_interior_x(hsep_interior *self, const hsep_splines *splines)
{
    return interior_open(self, splines).x;
}

HSEP_API double *hsep_interior_v(hsep_interior *self, const hsep_splines *splines)
{
    return interior_open(self, splines).v;
}

HSEP_API double *hsep_interior_low(hsep_interior *self, const hsep_splines *splines)
{
    return interior_open(self, splines).bound[0];
}

HSEP_API double *hsep_interior_high(hsep_interior *self, const hsep_splines *splines)
{
    return interior_open(self, splines).bound[1];
}

/* B x - b of a row: values - low, or high - values. */
static inline double interior_distance(int i, double value, double bound)
{
    return i == 0 ? value - bound : bound - value;
}

/* The rows of an order that the splines asked for touch, r = begin ... end - 1. */
typedef struct {
    uint64_t begin, end;
} interior_range;

static void interior_ranges(const hsep_splines *splines, uint64_t first, interior_range ranges[HSEP_ORDERS])
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_splines_touched(splines, first, order, &ranges[order].begin, &ranges[order].end);
        ranges[order].begin += order * splines->preview;
        ranges[order].end += order * splines->preview;
    }
}

/* The rows of P, a triangle, from the first one asked for. */
static const double *interior_asked(const hsep_interior *self, const hsep_splines *splines, const double P[])
{
    return P + (self->first * splines->n - self->first * (self->first - 1) / 2);
}

/* The proximal term that bounds A' W A by P / interior_regularisation: where active bounds hardly differ, its rounding
 * would outgrow P. */
static double interior_proximal(const hsep_splines *splines, const double *P, uint64_t n)
{
    double largest = 0.0;
    for (uint64_t i = 0; i < n; i++) {
        largest = fmax(largest, P[0]);
        P += n - i;
    }
    return interior_regularisation * hsep_splines_energy(splines) / largest;
}

HSEP_API void hsep_interior_begin(
    hsep_interior *self, const hsep_splines *splines, const double P[], uint64_t first, double cost)
{
    self->first = first;
    self->steps = 0;
    self->sides = 0.0;
    interior_arrays a = interior_open(self, splines);
    interior_range ranges[HSEP_ORDERS];
    interior_ranges(splines, first, ranges);
    self->rho = interior_proximal(splines, interior_asked(self, splines, P), a.n);
    hsep_splines_rows(splines, a.x, first, a.values);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        self->sides += 2.0 * (double)(ranges[order].end - ranges[order].begin);
    }
    self->cost = cost / self->sides;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                interior_side *side = &a.side[i];
                side->s[r] = fmax(interior_distance(i, a.values[r], a.bound[i][r]), interior_first_slack);
                side->z[r] = interior_first_gap * self->cost / side->s[r];
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
}

/* force := v - P x, P being the triangle of the splines first ... n - 1. */
static void interior_force(const interior_arrays *a, const double *P)
{
    memcpy(a->force, a->v, (size_t)a->n * sizeof(double));
    for (uint64_t i = 0; i < a->n; i++) {
        const double x = a->x[i];
        double sum = P[0] * x;
        for (uint64_t j = 1; j < a->n - i; j++) {
            sum += P[j] * a->x[i + j];
            a->force[i + j] -= P[j] * x;
        }
        a->force[i] -= sum;
        P += a->n - i;
    }
}

/* force := the dual residual v - P x + B' z, B' z's rows being in rows; return its largest entry as a share of the
 * largest one of its terms. */
static double interior_dual_residual(
    const interior_arrays *a, const hsep_splines *splines, uint64_t first, const double *P)
{
    double residual = 0.0, largest = 0.0;
    interior_force(a, P);
    memset(a->dx, 0, (size_t)a->n * sizeof(double));
    hsep_splines_transpose(splines, a->rows, first, a->dx);
    for (uint64_t j = 0; j < a->n; j++) {
        largest = fmax(fmax(largest, fabs(a->v[j])), fmax(fabs(a->v[j] - a->force[j]), fabs(a->dx[j])));
        a->force[j] += a->dx[j];
        residual = fmax(residual, fabs(a->force[j]));
    }
    return residual / largest;
}

/* dx := (P + A' W A)^-1 (force + A' rows), and what it does to the rows. */
static void interior_direction(const interior_arrays *a, const hsep_splines *splines, uint64_t first)
{
    memcpy(a->dx, a->force, (size_t)a->n * sizeof(double));
    hsep_splines_transpose(splines, a->rows, first, a->dx);
    hsep_cholesky_solve(a->triangle, a->n, a->dx);
    hsep_splines_rows(splines, a->dx, first, a->along);
}

/* A row of a side: its step, and the largest share of it with which s and z stay >= 0. */
typedef struct {
    double primal, dual;
} interior_room;

static inline void interior_limit(double *room, double value, double change)
{
    if (change < 0.0 && value < -change * *room) {
        *room = -value / change;
    }
}

/* ds = B dx + off + rho dz, dz = aim - z (B dx + off) / (s + rho z). */
static inline void interior_change(const interior_arrays *a, int i, uint64_t r, double *ds, double *dz)
{
    const interior_side *side = &a->side[i];
    const double to = (i == 0 ? a->along[r] : -a->along[r]) + side->off[r];
    *dz = side->aim[r] - side->z[r] * side->inverse[r] * to;
    *ds = to + a->rho * *dz;
}

/* rows := B' sides of aim - z off / (s + rho z), what the bounds add to the dual residual on the right-hand side. */
static void interior_push(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS])
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            double push[2];
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                push[i] = side->aim[r] - side->z[r] * side->inverse[r] * side->off[r];
            }
            a->rows[r] = push[0] - push[1];
        }
    }
}

static interior_room interior_rooms(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS])
{
    interior_room room = {1.0, 1.0};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                double ds, dz;
                interior_change(a, i, r, &ds, &dz);
                interior_limit(&room.primal, a->side[i].s[r], ds);
                interior_limit(&room.dual, a->side[i].z[r], dz);
            }
        }
    }
    return room;
}

/* mu, the mean of s z, and the largest primal residual; the weights of A' W A go to along, z's difference of the sides
 * to rows, and the predictor's aim is set, as if s z = 0 could be reached at once. */
static double interior_measure(
    const interior_arrays *a, const interior_range ranges[HSEP_ORDERS], double sides, double *primal)
{
    double sum = 0.0;
    *primal = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            double weight = 0.0;
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                side->off[r] = interior_distance(i, a->values[r], a->bound[i][r]) - side->s[r];
                sum += side->s[r] * side->z[r];
                *primal = fmax(*primal, fabs(side->off[r]));
                weight += side->z[r] * side->inverse[r];
                side->aim[r] = -side->s[r] * side->z[r] * side->inverse[r];
            }
            a->along[r] = weight;
            a->rows[r] = a->side[0].z[r] - a->side[1].z[r];
        }
    }
    return sum / sides;
}

/* The mean of s z after the predictor's step. */
static double interior_reached(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS], double sides)
{
    const interior_room room = interior_rooms(a, ranges);
    double sum = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                double ds, dz;
                interior_change(a, i, r, &ds, &dz);
                sum += (a->side[i].s[r] + room.primal * ds) * (a->side[i].z[r] + room.dual * dz);
            }
        }
    }
    return sum / sides;
}

/* The corrector's aim: the centre, with the curvature that the predictor shows. */
static void interior_correct(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS], double centre)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                double ds, dz;
                interior_change(a, i, r, &ds, &dz);
                side->aim[r] = (centre - side->s[r] * side->z[r] - ds * dz) * side->inverse[r];
            }
        }
    }
}

/* Go by the corrector's step, as far as s and z stay > 0. */
static void interior_move(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS])
{
    const interior_room room = interior_rooms(a, ranges);
    const double primal = room.primal >= 1.0 ? 1.0 : interior_way * room.primal;
    const double dual = room.dual >= 1.0 ? 1.0 : interior_way * room.dual;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                double ds, dz;
                interior_change(a, i, r, &ds, &dz);
                side->s[r] += primal * ds;
                side->z[r] += dual * dz;
                side->inverse[r] = 1.0 / (side->s[r] + a->rho * side->z[r]);
            }
        }
    }
    for (uint64_t j = 0; j < a->n; j++) {
        a->x[j] += primal * a->dx[j];
    }
}

HSEP_API int hsep_interior_step(hsep_interior *self, const hsep_splines *splines, const double P[])
{
    const interior_arrays a = interior_open(self, splines);
    interior_range ranges[HSEP_ORDERS];
    interior_ranges(splines, self->first, ranges);
    P = interior_asked(self, splines, P);

    double primal;
    hsep_splines_rows(splines, a.x, self->first, a.values);
    const double mu = interior_measure(&a, ranges, self->sides, &primal);
    const double dual = interior_dual_residual(&a, splines, self->first, P);
    if (self->steps == HSEP_INTERIOR_STEPS ||
        (mu < interior_gap * self->cost && primal < HSEP_INTERIOR_PRIMAL && dual < interior_dual)) {
        return 1;
    }
    self->steps++;
    memcpy(a.triangle, P, (size_t)(a.n * (a.n + 1) / 2) * sizeof(double));
    hsep_splines_gram(splines, a.along, self->first, a.triangle);
    if (!hsep_cholesky_factor(a.triangle, a.n)) {
        return 1;
    }
    /* Newton: P dx - B' dz = dual residual,  ds = B dx + off + rho dz,  z ds + s dz = aim (s + rho z) */
    interior_push(&a, ranges);
    interior_direction(&a, splines, self->first);
    const double share = interior_reached(&a, ranges, self->sides) / mu;
    interior_correct(&a, ranges, fmax(mu * share * share * share, 0.1 * interior_gap * self->cost));
    interior_push(&a, ranges);
    interior_direction(&a, splines, self->first);
    interior_move(&a, ranges);
    return 0;
}

#include "hsep_interior.h"

#include "hsep_cholesky.h"

#include <math.h>
#include <string.h>

static const double interior_tolerance = 1e-5;   /* complementarity at the end, as a share of that at the beginning */
static const double interior_outside = 1e-9;     /* distance from a bound that is taken for none, in shares */
static const double interior_first_slack = 1e-2; /* least distance from a bound to begin with */
static const double interior_way = 0.995;        /* share of the way to the nearest bound that a step goes */

/* One side of the bounds, B x >= b: slack s = B x - b, multiplier z, both > 0. */
typedef struct {
    double *s, *z;
    double *inverse; /* 1 / s */
    double *aim;     /* z ds + s dz of the step, divided by s */
} interior_side;

/* The arrays behind the struct. */
typedef struct {
    uint64_t n; /* entries of x */
    double *x, *v, *force, *dx;
    double *bound[2];          /* low and high */
    double *values, *along;    /* A x and A dx */
    double *rows;              /* work */
    interior_side side[2];
    double *triangle;
} interior_arrays;

HSEP_API double hsep_interior_size(uint64_t preview, uint64_t n)
{
    const double rows = HSEP_ORDERS * (double)preview, x = (double)n;
    return (double)sizeof(hsep_interior) + (4.0 * x + 13.0 * rows + 0.5 * x * (x + 1.0)) * (double)sizeof(double);
}

static interior_arrays interior_open(hsep_interior *self, const hsep_splines *splines)
{
    const uint64_t n = splines->n, rows = HSEP_ORDERS * splines->preview;
    interior_arrays a;
    double *at = (double *)(self + 1);
    a.n = n - self->first;
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

HSEP_API void hsep_interior_begin(hsep_interior *self, const hsep_splines *splines, uint64_t first, double cost)
{
    self->first = first;
    self->steps = 0;
    self->sides = 0.0;
    interior_arrays a = interior_open(self, splines);
    interior_range ranges[HSEP_ORDERS];
    interior_ranges(splines, first, ranges);
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
                side->inverse[r] = 1.0 / side->s[r];
                side->z[r] = self->cost * side->inverse[r];
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

/* ds = B dx + what B x - b - s is off, dz = aim - z ds / s. */
static inline void interior_change(
    const interior_arrays *a, int i, uint64_t r, double *ds, double *dz)
{
    const interior_side *side = &a->side[i];
    const double off = interior_distance(i, a->values[r], a->bound[i][r]) - side->s[r];
    *ds = (i == 0 ? a->along[r] : -a->along[r]) + off;
    *dz = side->aim[r] - side->z[r] * side->inverse[r] * *ds;
}

/* rows := B' sides of (aim + z - z off / s), the part of the right-hand side that the bounds make. */
static void interior_push(const interior_arrays *a, const interior_range ranges[HSEP_ORDERS])
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            double push[2];
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                const double off = interior_distance(i, a->values[r], a->bound[i][r]) - side->s[r];
                push[i] = side->aim[r] + side->z[r] - side->z[r] * side->inverse[r] * off;
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

/* The values of x, the mean of s z, the largest distance of B x - b from s; the weights of A' W A go to along, and the
 * predictor's aim is set, as if s z = 0 could be reached at once. */
static double interior_measure(
    const interior_arrays *a, const interior_range ranges[HSEP_ORDERS], double sides, double *outside)
{
    double sum = 0.0;
    *outside = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = ranges[order].begin; r < ranges[order].end; r++) {
            double weight = 0.0;
            for (int i = 0; i < 2; i++) {
                const interior_side *side = &a->side[i];
                const double off = interior_distance(i, a->values[r], a->bound[i][r]) - side->s[r];
                sum += side->s[r] * side->z[r];
                *outside = fmax(*outside, fabs(off));
                weight += side->z[r] * side->inverse[r];
                side->aim[r] = -side->z[r];
            }
            a->along[r] = weight;
        }
    }
    return sum / sides;
}

/* The mean of s z after the predictor's step. */
static double interior_reached(
    const interior_arrays *a, const interior_range ranges[HSEP_ORDERS], double sides)
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
                side->aim[r] = (centre - ds * dz) * side->inverse[r] - side->z[r];
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
                side->inverse[r] = 1.0 / side->s[r];
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
    P += self->first * splines->n - self->first * (self->first - 1) / 2; /* rows 0 ... first - 1 are left out */

    double outside;
    hsep_splines_rows(splines, a.x, self->first, a.values);
    const double mean = interior_measure(&a, ranges, self->sides, &outside);
    if (self->steps == HSEP_INTERIOR_STEPS ||
        (mean < interior_tolerance * self->cost && outside < interior_outside)) {
        return 1;
    }
    self->steps++;
    memcpy(a.triangle, P, (size_t)(a.n * (a.n + 1) / 2) * sizeof(double));
    hsep_splines_gram(splines, a.along, self->first, a.triangle);
    if (!hsep_cholesky_factor(a.triangle, a.n)) {
        return 1;
    }
    /* Newton: P dx - B' dz = v - P x + B' z,  ds = B dx + off,  z ds + s dz = s aim */
    interior_force(&a, P);
    interior_push(&a, ranges);
    interior_direction(&a, splines, self->first);
    const double share = interior_reached(&a, ranges, self->sides) / mean;
    interior_correct(&a, ranges, fmax(mean * share * share * share, 0.1 * interior_tolerance * self->cost));
    interior_push(&a, ranges);
    interior_direction(&a, splines, self->first);
    interior_move(&a, ranges);
    return 0;
}

#include "hsep_planner.h"

#include "hsep_cholesky.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define PLANNER_PINNED 8 /* samples at the beginning of a window in which a bounded plan follows the last one */

static const double planner_ridge = 1e-12;          /* on the diagonal, relative to its largest entry */
static const double planner_rounding = 1e-9;        /* share of a limit that is taken for rounding */
static const double planner_interior_share = 1e-10; /* by which a row at its bound may differ from the last plan */
static const double planner_moves = 1e-12;          /* m a sample, step of x_d that counts as a move */

static const uint64_t planner_first = sizeof(hsep_planner) / sizeof(double);

static double *planner_at(const hsep_planner *self, uint64_t offset) { return (double *)(uintptr_t)self + offset; }

static hsep_splines *planner_splines(const hsep_planner *self)
{
    return (hsep_splines *)planner_at(self, self->splines);
}

static hsep_interior *planner_interior(const hsep_planner *self)
{
    return (hsep_interior *)planner_at(self, self->interior);
}

static double planner_triangle(double n) { return 0.5 * n * (n + 1.0); }

HSEP_API double hsep_planner_size(const hsep_planner_parameters *parameters)
{
    const double preview = (double)parameters->preview;
    const uint64_t count = hsep_splines_count(parameters->preview, parameters->spacing);
    const double n = (double)count;
    const double doubles = 3.0 + n + (HSEP_ORDERS + 2.0) * preview + 2.0 * planner_triangle(n);
    return (double)sizeof(hsep_planner) + doubles * (double)sizeof(double) + hsep_splines_size(parameters->spacing) +
           hsep_interior_size(parameters->preview, count);
}

static uint64_t planner_take(uint64_t *end, double count)
{
    const uint64_t offset = *end;
    *end += (uint64_t)count;
    return offset;
}

static void planner_lay_out(hsep_planner *self, const hsep_planner_parameters *parameters)
{
    const double preview = (double)parameters->preview;
    const double n = (double)hsep_splines_count(parameters->preview, parameters->spacing);
    const uint64_t half = parameters->Np / 2;
    self->Np = parameters->Np;
    self->n_pinned = (half < PLANNER_PINNED ? half : PLANNER_PINNED) / parameters->spacing;
    self->size = (uint64_t)hsep_planner_size(parameters);
    self->keep_direction = parameters->keep_direction != 0;
    self->jerk_weight = parameters->jerk_weight;
    uint64_t end = planner_first;
    self->c = planner_take(&end, HSEP_DECIDED + n);
    self->total = planner_take(&end, HSEP_ORDERS * preview);
    self->moves = planner_take(&end, preview);
    self->third = planner_take(&end, preview);
    self->P = planner_take(&end, planner_triangle(n));
    self->factor = planner_take(&end, planner_triangle(n));
    self->splines = planner_take(&end, hsep_splines_size(parameters->spacing) / (double)sizeof(double));
    self->interior = end;
}

HSEP_API void hsep_planner_init(hsep_planner *self, const hsep_planner_parameters *parameters, double start)
{
    memset(self, 0, sizeof *self);
    planner_lay_out(self, parameters);
    const uint64_t end = self->size / sizeof(double);
    for (uint64_t i = planner_first; i < end; i++) {
        *planner_at(self, i) = 0.0;
    }
    for (int i = 0; i < 3; i++) {
        self->x_d_before[i] = start;
    }
    hsep_splines_init(planner_splines(self), parameters->preview, parameters->spacing, parameters->limit);
}

HSEP_API int hsep_planner_valid(const void *block, const hsep_planner_parameters *parameters)
{
    const char *bytes = block;
    hsep_planner expected, got;
    hsep_splines splines;
    hsep_interior interior;
    memcpy(&got, bytes, sizeof got);
    expected = got; /* what may differ from a fresh block is taken over, the rest must be equal */
    planner_lay_out(&expected, parameters);
    memcpy(&splines, bytes + expected.splines * sizeof(double), sizeof splines);
    memcpy(&interior, bytes + expected.interior * sizeof(double), sizeof interior);
    return memcmp(&expected, &got, sizeof got) == 0 && splines.preview == parameters->preview &&
           splines.spacing == parameters->spacing &&
           splines.n == hsep_splines_count(parameters->preview, parameters->spacing) &&
           interior.first <= expected.n_pinned && interior.steps <= HSEP_INTERIOR_STEPS;
}

HSEP_API const double *hsep_planner_spline(const hsep_planner *self)
{
    return hsep_splines_shape(planner_splines(self));
}

HSEP_API uint64_t hsep_planner_pinned(const hsep_planner *self)
{
    return self->n_pinned * planner_splines(self)->spacing;
}

HSEP_API double hsep_planner_decided(const hsep_planner *self, uint64_t k)
{
    return hsep_splines_sum(planner_splines(self), planner_at(self, self->c), HSEP_DECIDED, k);
}

HSEP_API double hsep_planner_delta(const hsep_planner *self, uint64_t k)
{
    const hsep_splines *splines = planner_splines(self);
    return hsep_splines_sum(splines, planner_at(self, self->c), HSEP_DECIDED + splines->n, k);
}

/* The third differences of what is decided of delta. */
static void planner_third(const hsep_planner *self)
{
    double *third = planner_at(self, self->third);
    const uint64_t preview = planner_splines(self)->preview;
    double d[4] = {self->delta_before[0], self->delta_before[1], self->delta_before[2], 0.0};
    for (uint64_t k = 0; k < preview; k++) {
        d[3] = hsep_planner_decided(self, k);
        third[k] = ((d[3] - d[2]) - (d[2] - d[1])) - ((d[2] - d[1]) - (d[1] - d[0]));
        d[0] = d[1], d[1] = d[2], d[2] = d[3];
    }
}

/* The rows of x_dm, and of delta in order 0, under the rest of the last plan, in shares; and which way x_d moves. */
static void planner_total(const hsep_planner *self, const double x_d[])
{
    const hsep_splines *splines = planner_splines(self);
    const uint64_t preview = splines->preview;
    double *total = planner_at(self, self->total), *moves = planner_at(self, self->moves);
    double last = self->x_d_before[2];
    double before[HSEP_ORDERS]; /* differences of orders 0 to 2 at the sample before */
    double y[3];
    for (int i = 0; i < 3; i++) {
        y[i] = self->x_d_before[i] + self->delta_before[i];
    }
    before[0] = y[2];
    before[1] = y[2] - y[1];
    before[2] = (y[2] - y[1]) - (y[1] - y[0]);
    for (uint64_t k = 0; k < preview; k++) {
        const double delta = hsep_planner_delta(self, k), step = x_d[k] - last;
        double now[HSEP_ORDERS];
        last = x_d[k];
        moves[k] = self->keep_direction ? (double)((step > planner_moves) - (step < -planner_moves)) : 0.0;
        now[0] = x_d[k] + delta;
        total[k] = delta * splines->share[0];
        for (unsigned order = 1; order < HSEP_ORDERS; order++) {
            now[order] = now[order - 1] - before[order - 1];
            total[order * preview + k] = now[order] * splines->share[order];
        }
        for (unsigned order = 0; order < HSEP_ORDERS - 1; order++) {
            before[order] = now[order];
        }
    }
}

/* P := W' W + jerk_weight D' D with a small ridge. */
static void planner_quadratic(const hsep_planner *self, const double filtered[])
{
    const hsep_splines *splines = planner_splines(self);
    double *P = planner_at(self, self->P);
    hsep_splines_filtered_gram(splines, filtered, P);
    hsep_splines_jerk_gram(splines, self->jerk_weight, P);
    double largest = 0.0;
    uint64_t place = 0;
    for (uint64_t i = 0; i < splines->n; i++) {
        largest = fmax(largest, P[place]);
        place += splines->n - i;
    }
    place = 0;
    for (uint64_t i = 0; i < splines->n; i++) {
        P[place] += planner_ridge * largest;
        place += splines->n - i;
    }
}

/* What a row may be, in shares. What the rest of the last plan demands is always allowed, and a little more: bounds
 * without an interior are none for an interior-point method. */
static void planner_range(const hsep_planner *self, uint64_t r, double *least, double *most)
{
    const uint64_t preview = planner_splines(self)->preview;
    const double total = planner_at(self, self->total)[r];
    *most = 1.0 - planner_rounding;
    *least = -*most;
    if (r >= preview && r < 2 * preview) { /* velocities */
        const double moves = planner_at(self, self->moves)[r - preview];
        *least = moves > 0.0 ? 0.0 : *least;
        *most = moves < 0.0 ? 0.0 : *most;
    }
    *least = fmin(*least, total - planner_interior_share);
    *most = fmax(*most, total + planner_interior_share);
}

/* The largest share, 0 ... 1, of the way from the rest, whose rows are in total, by rows of way, within the limits. */
static double planner_share(const hsep_planner *self, const double way[])
{
    const double *total = planner_at(self, self->total);
    const uint64_t rows = HSEP_ORDERS * planner_splines(self)->preview;
    double share = 1.0;
    for (uint64_t r = 0; r < rows; r++) {
        double least, most;
        planner_range(self, r, &least, &most);
        const double to = fabs(way[r]), room = way[r] > 0.0 ? most - total[r] : total[r] - least;
        if (to > planner_rounding && room < share * to) {
            share = room / to;
        }
    }
    return share;
}

/* Whether the rows of way, added to those of the rest, keep the limits. */
static int planner_allows(const hsep_planner *self, const double way[])
{
    const double *total = planner_at(self, self->total);
    const uint64_t rows = HSEP_ORDERS * planner_splines(self)->preview;
    for (uint64_t r = 0; r < rows; r++) {
        const double there = total[r] + way[r];
        double least, most;
        planner_range(self, r, &least, &most);
        if (!(there <= most && there >= least)) {
            return 0;
        }
    }
    return 1;
}

/* Hand the bounded problem over: x is what follows the pinned splines, its bounds are what the others leave. */
static void planner_bound(hsep_planner *self, double cost)
{
    const hsep_splines *splines = planner_splines(self);
    hsep_interior *interior = planner_interior(self);
    const uint64_t n = splines->n, first = self->n_pinned, preview = splines->preview;
    const double *rest = planner_at(self, self->c) + HSEP_DECIDED, *P = planner_at(self, self->P);
    const double *total = planner_at(self, self->total);
    double *x = hsep_interior_x(interior, splines), *v = hsep_interior_v(interior, splines);
    double *low = hsep_interior_low(interior, splines), *high = hsep_interior_high(interior, splines);
    hsep_splines_rows(splines, rest + first, first, low);
    for (uint64_t r = 0; r < HSEP_ORDERS * preview; r++) {
        const double other = total[r] - low[r];
        double least, most;
        planner_range(self, r, &least, &most);
        low[r] = least - other + HSEP_INTERIOR_PRIMAL;
        high[r] = most - other - HSEP_INTERIOR_PRIMAL;
    }
    for (uint64_t i = 0; i < first; i++) { /* v := v_2 - P_21 pinned */
        for (uint64_t j = first; j < n; j++) {
            v[j] -= P[j - i] * rest[i];
        }
        P += n - i;
    }
    for (uint64_t j = first; j < n; j++) {
        v[j - first] = v[j];
        x[j - first] = rest[j];
    }
    hsep_interior_begin(interior, splines, planner_at(self, self->P), first, cost);
}

HSEP_API hsep_plan_status
hsep_planner_begin(hsep_planner *self, const double filtered[], const double target[], const double x_d[])
{
    const hsep_splines *splines = planner_splines(self);
    const uint64_t n = splines->n;
    double *c = planner_at(self, self->c), *P = planner_at(self, self->P);
    double *factor = planner_at(self, self->factor);
    hsep_interior *interior = planner_interior(self);
    double *free_minimum = hsep_interior_x(interior, splines), *v = hsep_interior_v(interior, splines);
    double *rows = hsep_interior_low(interior, splines); /* work */

    planner_third(self);
    planner_total(self, x_d);
    planner_quadratic(self, filtered);
    hsep_splines_project(splines, filtered, target, self->jerk_weight, planner_at(self, self->third), v);
    memcpy(factor, P, (size_t)planner_triangle((double)n) * sizeof(double));
    if (!hsep_cholesky_factor(factor, n)) {
        return HSEP_PLAN_FAILED;
    }
    memcpy(free_minimum, v, (size_t)n * sizeof(double));
    hsep_cholesky_solve(factor, n, free_minimum);
    double cost = 0.0, finite = 0.0;
    for (uint64_t j = 0; j < n; j++) {
        cost += v[j] * free_minimum[j];
        finite += fabs(free_minimum[j]);
        free_minimum[j] -= c[HSEP_DECIDED + j]; /* the way there */
    }
    if (!isfinite(finite)) {
        return HSEP_PLAN_FAILED;
    }
    hsep_splines_rows(splines, free_minimum, 0, rows);
    if (planner_allows(self, rows)) {
        for (uint64_t j = 0; j < n; j++) {
            c[HSEP_DECIDED + j] += free_minimum[j];
        }
        return HSEP_PLAN_DONE;
    }
    const double *row = P;
    for (uint64_t i = 0; i < n; i++) { /* cost += rest' P rest */
        const double *rest = c + HSEP_DECIDED + i;
        double sum = 0.5 * row[0] * rest[0];
        for (uint64_t j = 1; j < n - i; j++) {
            sum += row[j] * rest[j];
        }
        cost += 2.0 * rest[0] * sum;
        row += n - i;
    }
    planner_bound(self, cost);
    return HSEP_PLAN_BOUNDED;
}

HSEP_API int hsep_planner_step(hsep_planner *self)
{
    const hsep_splines *splines = planner_splines(self);
    hsep_interior *interior = planner_interior(self);
    if (!hsep_interior_step(interior, splines, planner_at(self, self->P))) {
        return 0;
    }
    double *way = hsep_interior_x(interior, splines), *rows = hsep_interior_low(interior, splines);
    double *rest = planner_at(self, self->c) + HSEP_DECIDED + self->n_pinned;
    const uint64_t n = splines->n - self->n_pinned;
    double finite = 0.0;
    for (uint64_t j = 0; j < n; j++) {
        way[j] -= rest[j];
        finite += fabs(way[j]);
    }
    if (isfinite(finite)) {
        hsep_splines_rows(splines, way, self->n_pinned, rows);
        const double share = planner_share(self, rows);
        for (uint64_t j = 0; j < n; j++) {
            rest[j] += share * way[j];
        }
    }
    return 1;
}

HSEP_API void hsep_planner_next(hsep_planner *self, const double x_d[])
{
    const hsep_splines *splines = planner_splines(self);
    double *c = planner_at(self, self->c);
    for (uint64_t k = self->Np > 3 ? self->Np - 3 : 0; k < self->Np; k++) {
        for (int i = 0; i < 2; i++) {
            self->delta_before[i] = self->delta_before[i + 1];
            self->x_d_before[i] = self->x_d_before[i + 1];
        }
        self->delta_before[2] = hsep_planner_delta(self, k);
        self->x_d_before[2] = x_d[k];
    }
    const uint64_t kept = self->Np / splines->spacing, n = HSEP_DECIDED + splines->n;
    for (uint64_t i = 0; i < n; i++) {
        c[i] = i + kept < n ? c[i + kept] : 0.0;
    }
}

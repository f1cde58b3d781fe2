#include "hsep_planner.h"

#include "hsep_cholesky.h"
#include "hsep_interior.h"
#include "hsep_stop.h"

/* Where the solver ends. */
static hsep_tolerance planner_tolerance(hsep_int averaging)
{
    static const hsep_tolerance exact = {HSEP_QP_EXACT};
    hsep_tolerance averaged = {HSEP_NEWTON_TOLERANCE};
#ifdef HSEP_FLOAT32
    averaged.margin = 1e-4F; /* rounding leaves up to 2e-4 of a bound of third differences */
#endif
    return averaging ? averaged : exact;
}

/* Where its programme is; x: the change that was found last. */
static hsep_problem planner_problem(hsep_planner *self)
{
    return hsep_interior_problem(hsep_part(self, self->interior), hsep_planner_splines(self));
}

HSEP_API hsep_real *hsep_planner_linear(hsep_planner *self) { return planner_problem(self).v; }

/* Splines that a bounded plan leaves as they are. */
static hsep_int planner_n_pinned(const hsep_predictor_parameters *parameters)
{
    const hsep_int most = parameters->averaging.averaging ? HSEP_PLANNING_PINNED_AVERAGED : HSEP_PLANNING_PINNED_PAPER;
    return hsep_min(parameters->settings.Np / 2, most) / parameters->compensator.spacing;
}

HSEP_API hsep_knots hsep_planner_knots(const hsep_predictor_parameters *parameters)
{
    const hsep_int spacing = parameters->compensator.spacing, n = hsep_splines_count(parameters->horizon, spacing);
    const int wider = parameters->averaging.averaging && parameters->horizon == parameters->preview;
    return hsep_knots_of(n - planner_n_pinned(parameters), wider ? parameters->settings.Np / spacing : 0);
}

HSEP_API hsep_real hsep_planner_lay_out(hsep_planner *self, const hsep_predictor_parameters *parameters)
{
    const hsep_int spacing = parameters->compensator.spacing, n = hsep_splines_count(parameters->horizon, spacing);
    const hsep_real horizon = (hsep_real)parameters->horizon;
    hsep_real end = HSEP_WORDS(hsep_planner);
    self->Np = parameters->settings.Np;
    self->n_pinned = planner_n_pinned(parameters);
    self->no_reversal = parameters->compensator.no_reversal;
    self->averaging = parameters->averaging.averaging;
    self->steps = planner_tolerance(self->averaging).steps;
    self->knots = hsep_planner_knots(parameters);
    self->jerk_weight = parameters->compensator.jerk_weight;
    self->c = hsep_take(&end, HSEP_N_DECIDED + (hsep_real)n);
    self->low = hsep_take(&end, HSEP_ORDERS * horizon);
    self->high = hsep_take(&end, HSEP_ORDERS * horizon);
    self->third = hsep_take(&end, horizon);
    self->P = hsep_take(&end, hsep_triangle(n));
    self->splines = hsep_take_block(&end, hsep_splines_lay_out(&(hsep_splines){0}, parameters->horizon, spacing));
    self->interior = hsep_take_block(&end, hsep_interior_size(parameters->horizon, n));
    if (parameters->preview < parameters->horizon) {
        self->stop = hsep_take_block(&end, hsep_stop_lay_out(&(hsep_stop){0}, parameters, self->n_pinned));
    }
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_planner_init(hsep_planner *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    const hsep_compensator_settings *settings = &parameters->compensator;
    const hsep_real T_s = parameters->settings.T_s;
    const hsep_real limits[HSEP_ORDERS] = {
        settings->change_max, settings->v_max * T_s, settings->a_max * (T_s * T_s),
        settings->j_max * (T_s * T_s * T_s)};
    (void)hsep_planner_lay_out(self, parameters);
    for (int i = 0; i < 3; i++) {
        self->x_d_before[i] = start;
    }
    hsep_splines_init(hsep_part(self, self->splines), parameters->horizon, settings->spacing, limits);
    if (self->stop > 0) {
        hsep_stop_init(hsep_part(self, self->stop), parameters, self->n_pinned, hsep_planner_splines(self));
    }
}

/* Bounds of the rows of a change beyond the first count coefficients of the last plan's remainder, (4 n,) in
 * shares: the limits, with a share of change_max, without what x_d and these coefficients take of them. Where x_d
 * exceeds one within the length of a spline, as a command that is held or rounded does, the limit is wider by that. */
static void planner_limits(
    const hsep_planner *self, const hsep_real x_d[], hsep_int count, hsep_int n, hsep_int turns, hsep_real change_max,
    hsep_real low[], hsep_real high[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    /* apart: a sum would be rounded to what a position is, much coarser than a third difference of a change */
    hsep_real path[HSEP_ORDERS], change[HSEP_ORDERS];
    hsep_splines_exceeded(splines, x_d, self->x_d_before, n, high);
    hsep_differ_from(path, self->x_d_before);
    hsep_differ_from(change, self->delta_before);
    for (hsep_int k = 0; k < n; k++) {
        hsep_differ(path, x_d[k]);
        hsep_differ(change, hsep_splines_sum(splines, hsep_at_const(self, self->c), count, k));
        for (unsigned order = 0; order < HSEP_ORDERS; order++) {
            const hsep_int r = order * n + k;
            const hsep_real taken = ((order > 0 ? path[order] : 0.0) + change[order]) * splines->share[order];
            const hsep_real exceeded = high[r], room = (1.0 - HSEP_LIMITS_ROUNDING) * (order > 0 ? 1.0 : change_max);
            const int keeps = order == 1 && k >= turns; /* the direction of x_d */
            const hsep_real least = keeps && path[1] > HSEP_LIMITS_MOVES ? 0.0 : hsep_fmin(exceeded, 0.0) - room;
            const hsep_real most = keeps && path[1] < -HSEP_LIMITS_MOVES ? 0.0 : hsep_fmax(exceeded, 0.0) + room;
            low[r] = least - taken;
            high[r] = most - taken;
        }
    }
}

/* Third differences of delta under the first count coefficients c, (horizon,), m; return the sum of their squares. */
static hsep_real planner_third(const hsep_planner *self, const hsep_real c[], hsep_int count, hsep_real third[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    hsep_real now[HSEP_ORDERS], squares = 0.0;
    hsep_differ_from(now, self->delta_before);
    for (hsep_int k = 0; k < splines->horizon; k++) {
        hsep_differ(now, hsep_splines_sum(splines, c, count, k));
        third[k] = now[3];
        squares += third[k] * third[k];
    }
    return squares;
}

HSEP_API void hsep_planner_open(hsep_planner *self, const hsep_real x_d[], hsep_int turns, hsep_real change)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    const hsep_int count = HSEP_N_DECIDED + splines->n;
    hsep_real *low = hsep_at(self, self->low), *high = hsep_at(self, self->high);
    self->solved = self->knots;
    planner_limits(self, x_d, count, splines->horizon, self->no_reversal ? turns : splines->horizon, change, low, high);
    (void)planner_third(self, hsep_at(self, self->c), count, hsep_at(self, self->third));
    /* No change is always feasible, with a small margin: an interior-point method needs an interior */
    for (hsep_int r = 0; r < HSEP_ORDERS * splines->horizon; r++) {
        low[r] = hsep_fmin(low[r], -HSEP_LIMITS_INTERIOR);
        high[r] = hsep_fmax(high[r], HSEP_LIMITS_INTERIOR);
    }
}

/* Largest feasible length, 0 ... 1, of a step with rows way from a change with rows from. */
static hsep_real planner_share(const hsep_planner *self, const hsep_real from[], const hsep_real way[])
{
    const hsep_real *low = hsep_at_const(self, self->low), *high = hsep_at_const(self, self->high);
    hsep_real share = 1.0;
    for (hsep_int r = 0; r < HSEP_ORDERS * hsep_planner_splines(self)->horizon; r++) {
        const hsep_real to = hsep_fabs(way[r]), room = way[r] > 0.0 ? high[r] - from[r] : from[r] - low[r];
        if (to > HSEP_LIMITS_ROUNDING && room < share * to) {
            share = room / to;
        }
    }
    return share;
}

HSEP_API hsep_real hsep_planner_jerk(const hsep_planner *self, const hsep_real c[], hsep_real work[])
{
    return self->jerk_weight * planner_third(self, c, HSEP_N_DECIDED + hsep_planner_splines(self)->n, work);
}

/* The first spline that this cost is of. */
static hsep_int planner_first(const hsep_planner *self) { return hsep_planner_splines(self)->n - self->solved.n; }

/* Rows of splines x, (m,), of this cost. */
static void planner_rows(hsep_planner *self, const hsep_real x[], hsep_real rows[])
{
    hsep_knots_rows(&self->solved, hsep_planner_splines(self), x, planner_problem(self).c, rows);
}

HSEP_API void hsep_planner_complete(hsep_planner *self, hsep_real jerk_weight)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    const hsep_int n = self->solved.m, horizon = splines->horizon;
    const hsep_problem problem = planner_problem(self);
    const hsep_real *third = hsep_at(self, self->third), share = splines->share[3];
    hsep_real *P = hsep_planner_quadratic(self), *diagonal = P, largest = 0.0, *rows = problem.low;
    hsep_zero(rows, HSEP_ORDERS * horizon); /* third differences, as rows, without their limit */
    for (hsep_int k = 0; k < horizon; k++) {
        rows[3 * horizon + k] = jerk_weight / (share * share);
    }
    hsep_splines_gram(splines, rows, planner_first(self), problem.products, problem.high);
    hsep_knots_add(&self->solved, problem.products, P, problem.c);
    for (hsep_int k = 0; k < horizon; k++) {
        rows[3 * horizon + k] = -jerk_weight / share * third[k];
    }
    hsep_zero(problem.c, self->solved.n);
    hsep_splines_transpose(splines, rows, planner_first(self), problem.c);
    hsep_knots_narrow(&self->solved, problem.c, problem.v);
    for (hsep_int i = 0; i < n; i++) {
        largest = hsep_fmax(largest, *diagonal);
        diagonal += n - i;
    }
    for (hsep_int i = 0; i < n; i++) {
        *P += HSEP_SPLINES_RIDGE * largest;
        P += n - i;
    }
}

HSEP_API void hsep_planner_aim(
    hsep_planner *self, const hsep_real filtered[], const hsep_real target[], hsep_real jerk_weight)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    hsep_real *v = hsep_planner_linear(self);
    self->solved = hsep_knots_of(splines->n, 0);
    for (hsep_int j = 0; j < splines->n; j++) { /* W' target */
        const hsep_int begin = j * splines->spacing;
        v[j] = hsep_dot(filtered, target + begin, splines->horizon - begin);
    }
    hsep_splines_filtered_gram(splines, filtered, hsep_planner_quadratic(self));
    hsep_planner_complete(self, jerk_weight);
}

/* Reduce the cost to the splines that are not pinned. */
static void planner_pin(hsep_planner *self)
{
    const hsep_int n = self->solved.n, left = self->knots.n;
    hsep_real *v = hsep_planner_linear(self), *P = hsep_planner_quadratic(self);
    if (n > left) {
        self->solved = hsep_knots_of(left, 0);
        hsep_copy(v, v + (n - left), left);
        hsep_copy(P, P + (hsep_int)(hsep_triangle(n) - hsep_triangle(left)), (hsep_int)hsep_triangle(left));
    }
}

HSEP_API void hsep_planner_end(hsep_planner *self, const hsep_real x_d[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    const hsep_int horizon = splines->horizon, unknown = self->Np / splines->spacing, n = self->knots.n;
    hsep_real *spline = planner_problem(self).low, *target = spline + horizon;
    hsep_planner_open(self, x_d, 0, 1.0);
    hsep_zero(spline, horizon);
    hsep_copy(spline, hsep_splines_shape(splines), 4 * splines->spacing);
    for (hsep_int k = 0; k < horizon; k++) {
        target[k] = -hsep_planner_delta(self, k);
    }
    const hsep_real gain = 2.0 * hsep_sin(0.5 * HSEP_TWO_PI * HSEP_PLANNING_ENDS / (hsep_real)horizon);
    hsep_planner_aim(self, spline, target, hsep_pow(gain, -6.0)); /* gain of a difference at that period */
    planner_pin(self);
    for (hsep_int i = n > unknown ? n - unknown : 0; i < n; i++) {
        hsep_planner_quadratic(self)[i * n - i * (i - 1) / 2] *= HSEP_PLANNING_NEW;
    }
}

/* Change the remainder of the last plan by a step x, (m,), m, of this cost. */
static void planner_take(hsep_planner *self, const hsep_real x[])
{
    hsep_real *rest = hsep_at(self, self->c) + HSEP_N_DECIDED + planner_first(self), *c = planner_problem(self).c;
    hsep_knots_widen(&self->solved, x, c);
    hsep_axpy(rest, 1.0, c, self->solved.n);
}

HSEP_API hsep_plan_status hsep_planner_solve(hsep_planner *self, hsep_int steps)
{
    const hsep_int n = self->solved.m;
    const hsep_splines *splines = hsep_planner_splines(self);
    const hsep_problem problem = planner_problem(self);
    hsep_real *free_minimum = problem.x, cost = 0.0;
    hsep_copy(problem.factor, hsep_planner_quadratic(self), (hsep_int)hsep_triangle(n));
    if (!hsep_cholesky_rows(problem.factor, n, 0, n, NULL)) {
        return HSEP_PLAN_FAILED;
    }
    hsep_copy(free_minimum, problem.v, n);
    hsep_cholesky_solve(problem.factor, n, free_minimum);
    for (hsep_int j = 0; j < n; j++) {
        cost += problem.v[j] * free_minimum[j];
    }
    if (!isfinite(cost)) {
        return HSEP_PLAN_FAILED;
    }
    planner_rows(self, free_minimum, problem.low);
    hsep_zero(problem.high, HSEP_ORDERS * splines->horizon);
    if (planner_share(self, problem.high, problem.low) == 1.0) {
        planner_take(self, free_minimum);
        return HSEP_PLAN_DONE;
    }
    planner_pin(self);
    hsep_tolerance tolerance = planner_tolerance(self->averaging);
    tolerance.steps = steps;
    for (hsep_int r = 0; r < HSEP_ORDERS * splines->horizon; r++) {
        problem.low[r] = hsep_at(self, self->low)[r] + tolerance.margin;
        problem.high[r] = hsep_at(self, self->high)[r] - tolerance.margin;
    }
    hsep_interior_begin(
        hsep_part(self, self->interior), splines, &self->solved, hsep_planner_quadratic(self), cost, &tolerance);
    return HSEP_PLAN_BOUNDED;
}

HSEP_API hsep_plan_status hsep_planner_advance(hsep_planner *self)
{
    const hsep_splines *splines = hsep_planner_splines(self);
    hsep_interior *interior = hsep_part(self, self->interior);
    if (!hsep_interior_advance(interior, splines, hsep_planner_quadratic(self))) {
        return HSEP_PLAN_BOUNDED;
    }
    const int found = interior->beyond < interior->tolerance.margin; /* something within the bounds */
    const hsep_problem problem = planner_problem(self);
    hsep_real *way = problem.x, *at = problem.v, *rows = problem.low, *from = problem.high, finite = 0.0;
    for (hsep_int j = 0; j < self->solved.m; j++) {
        at[j] = found ? problem.inner[j] : 0.0;
        way[j] -= at[j];
        finite += hsep_fabs(way[j]);
    }
    planner_rows(self, way, rows);
    planner_rows(self, at, from);
    const hsep_real share = planner_share(self, from, rows);
    for (hsep_int j = 0; j < self->solved.m; j++) { /* bounds that are exceeded as steps are limited are so by little */
        way[j] = isfinite(finite) ? at[j] + share * way[j] : 0.0;
    }
    planner_take(self, way);
    return HSEP_PLAN_DONE;
}

HSEP_API void hsep_planner_carry_out(hsep_planner *self, const hsep_real x_d[])
{
    if (self->stop > 0) {
        hsep_stop *stop = hsep_part(self, self->stop);
        hsep_real *low = hsep_at(self, self->low), *high = hsep_at(self, self->high);
        planner_limits(self, x_d, 0, stop->preview, stop->preview, 1.0, low, high);
        hsep_stop_carry_out(stop, hsep_planner_splines(self), low, high, hsep_at(self, self->c));
    }
}

HSEP_API void hsep_planner_next(hsep_planner *self, const hsep_real x_d[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    hsep_real *c = hsep_at(self, self->c);
    for (hsep_int k = self->Np > 3 ? self->Np - 3 : 0; k < self->Np; k++) {
        hsep_copy(self->delta_before, self->delta_before + 1, 2);
        hsep_copy(self->x_d_before, self->x_d_before + 1, 2);
        self->delta_before[2] = hsep_planner_delta(self, k);
        self->x_d_before[2] = x_d[k];
    }
    const hsep_int kept = self->Np / splines->spacing, n = HSEP_N_DECIDED + splines->n;
    for (hsep_int i = 0; i < n; i++) {
        c[i] = i + kept < n ? c[i + kept] : 0.0;
    }
    if (self->stop > 0) {
        const hsep_stop *stop = hsep_part_const(self, self->stop);
        hsep_real *last = hsep_at(self, self->stop + stop->last);
        for (hsep_int i = 0; i < stop->count; i++) {
            last[i] = last[hsep_min(i + kept, stop->count - 1)];
        }
    }
}

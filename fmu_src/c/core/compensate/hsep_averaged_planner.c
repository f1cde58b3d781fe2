#include "hsep_averaged_planner.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>
#include <string.h>

static const hsep_real averaged_planner_reaches[] = {HSEP_NEWTON_REACHES};
static const hsep_real averaged_planner_lengths[] = {HSEP_NEWTON_LENGTHS};
static const hsep_int averaged_planner_solved[] = {HSEP_NEWTON_SOLVED};

HSEP_ASSERT(reaches, sizeof averaged_planner_reaches == HSEP_AVERAGED_STEPS * sizeof(hsep_real));
HSEP_ASSERT(lengths, sizeof averaged_planner_lengths == HSEP_AVERAGED_TRIES * sizeof(hsep_real));
HSEP_ASSERT(solved, sizeof averaged_planner_solved == (1 + HSEP_AVERAGED_STEPS) * sizeof(hsep_int));

/* Where the solver of a programme ends: of the physics model's plan, 0, or of a Newton step. In single precision
 * rounding leaves up to 2e-4 of a bound of third differences, so that the margin is wider. */
static hsep_tolerance averaged_planner_tolerance(hsep_int programme)
{
    hsep_tolerance tolerance = {HSEP_NEWTON_TOLERANCE};
#ifdef HSEP_FLOAT32
    tolerance.margin = 1e-4F;
#endif
    tolerance.steps = averaged_planner_solved[programme];
    return tolerance;
}

/* Whether a plan costs less than another; not if it is NaN. */
static int averaged_planner_better(hsep_real cost, hsep_real other)
{
    return cost < (1.0 - HSEP_NEWTON_LEAST_GAIN) * other;
}

static void averaged_planner_copy(hsep_averaged_planner *self, hsep_real to[], const hsep_real from[])
{
    memcpy(to, from, (size_t)(HSEP_N_DECIDED + self->n) * sizeof(hsep_real));
}

/* Commands under the first count coefficients of a plan, and the response of the physics model to them. */
static void averaged_planner_command(
    hsep_averaged_planner *self, const hsep_averaged_task *task, const hsep_real c[], hsep_int count)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    hsep_real *command = hsep_at(self, self->command), *x_pb = hsep_at(self, self->x_pb);
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    memcpy(trial, hsep_at(self, self->physics), (size_t)(self->trial - self->physics) * sizeof(hsep_real));
    for (hsep_int k = 0; k < self->preview; k++) {
        const hsep_int j = self->preview - 1 - k;
        command[j] = task->x_d[k] - self->start + hsep_splines_sum(splines, c, count, k);
        hsep_physics_forced_response(trial, &command[j], &x_pb[j], 1);
    }
}

/* Predict the commands of a plan in two calls, with the variances under the remainder of the last plan; return
 * whether all are predicted. */
static int averaged_planner_predicts(hsep_averaged_planner *self, const hsep_averaged_task *task, const hsep_real c[])
{
    const hsep_int all = self->preview + self->late;
    hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    if (self->predicted == 0) {
        self->predicted = all / HSEP_AVERAGED_AT_FIRST;
        averaged_planner_command(self, task, c, HSEP_N_DECIDED + self->n);
        hsep_averaged_predict(task->model, hsep_at(self, self->command), x_pb, e_h, self->predicted, 0);
        return 0;
    }
    hsep_averaged_go_on(task->model, x_pb, e_h, self->predicted, all, 0);
    self->predicted = 0;
    return 1;
}

/* Cost of the plan that was predicted last, m2; not finite if the prediction overflows. */
static hsep_real averaged_planner_cost(
    const hsep_averaged_planner *self, const hsep_averaged_task *task, const hsep_real c[])
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_int count = HSEP_N_DECIDED + self->n;
    const hsep_real *x_pb = hsep_at_const(self, self->x_pb), *e_h = hsep_at_const(self, self->e_h);
    const hsep_real *before = task->planner->delta_before;
    hsep_real d[4] = {before[0], before[1], before[2], 0.0}, error = 0.0, jerk = 0.0;
    for (hsep_int k = 0; k < self->preview; k++) {
        const hsep_int j = self->preview - 1 - k;
        const hsep_real e = task->x_d[k] - self->start - (x_pb[j] + e_h[j]);
        d[3] = hsep_splines_sum(splines, c, count, k);
        const hsep_real third = ((d[3] - d[2]) - (d[2] - d[1])) - ((d[2] - d[1]) - (d[1] - d[0]));
        error += e * e;
        jerk += third * third;
        d[0] = d[1], d[1] = d[2], d[2] = d[3];
    }
    return error + task->planner->jerk_weight * jerk;
}

/* The plan is made: its window is to be predicted. */
static void averaged_planner_end(hsep_averaged_planner *self)
{
    self->predicted = 0;
    self->stage = HSEP_AVERAGED_PREDICT;
}

/* Some of the window's samples under the plan, and their variances. */
static void averaged_planner_window(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_int first = self->predicted, all = self->late + self->Np, left = all - first;
    const hsep_int last = first + (left < HSEP_AVERAGED_VARIED ? left : HSEP_AVERAGED_VARIED);
    hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    if (first == 0) {
        averaged_planner_command(self, task, hsep_planner_coefficients(task->planner), HSEP_N_DECIDED + self->n);
        hsep_averaged_predict(task->model, hsep_at(self, self->command), x_pb, e_h, last, 1);
    } else {
        hsep_averaged_go_on(task->model, x_pb, e_h, first, last, 1);
    }
    self->predicted = last;
    self->stage = last < all ? HSEP_AVERAGED_PREDICT : HSEP_AVERAGED_DONE;
}

/* The physics model's plan is made: try a better one, if there may be one. */
static void averaged_planner_continue(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    hsep_real *c = hsep_planner_coefficients(task->planner), *rest = hsep_at(self, self->rest);
    self->planned = 1;
    if (!self->judges) {
        averaged_planner_end(self);
        return;
    }
    self->stage = HSEP_AVERAGED_COMPARE;
    averaged_planner_copy(self, hsep_at(self, self->of_physics), c);
    if (self->follows) {
        self->stage = HSEP_AVERAGED_STEP;
        averaged_planner_copy(self, hsep_at(self, self->best), rest);
        averaged_planner_copy(self, c, rest);
        hsep_planner_let_turn(task->planner);
        hsep_planner_decide_pinned(task->planner);
    }
}

/* Begin the physics model's plan. */
static void averaged_planner_physics(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb);
    hsep_real *target = hsep_at(self, self->target); /* x_d minus its response to x_d with what is decided of delta */
    averaged_planner_command(self, task, hsep_at(self, self->rest), HSEP_N_DECIDED);
    for (hsep_int k = 0; k < self->preview; k++) {
        target[k] = task->x_d[k] - self->start - x_pb[self->preview - 1 - k];
    }
    hsep_planner_open(task->planner, task->x_d);
    self->stage = HSEP_AVERAGED_AIM;
}

/* Make its programme. */
static void averaged_planner_aim(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    hsep_planner_aim(task->planner, task->spline, hsep_at(self, self->target));
    hsep_planner_pin(task->planner);
    self->stage = HSEP_AVERAGED_AIMED;
}

/* Solve it; without one the remainder of the last plan goes on. */
static void averaged_planner_solve_physics(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_tolerance tolerance = averaged_planner_tolerance(0);
    const hsep_plan_status status = hsep_planner_solve(task->planner, 1, &tolerance);
    if (status == HSEP_PLAN_DONE) {
        averaged_planner_continue(self, task);
    } else if (status == HSEP_PLAN_BOUNDED) {
        self->stage = HSEP_AVERAGED_PHYSICS;
    } else {
        averaged_planner_end(self);
    }
}

HSEP_API void hsep_averaged_planner_begin(
    hsep_averaged_planner *self, const hsep_averaged_task *task, const hsep_averaged_before *before, hsep_int best,
    int warm)
{
    const size_t late = (size_t)self->late * sizeof(hsep_real);
    hsep_real *path = hsep_at(self, self->target), *rest = hsep_at(self, self->rest);
    self->steps = self->tries = self->planned = self->predicted = self->bounded = 0;
    averaged_planner_copy(self, rest, hsep_planner_coefficients(task->planner));
    memcpy(hsep_at(self, self->physics), before->physics, (size_t)(self->trial - self->physics) * sizeof(hsep_real));
    memcpy(hsep_at(self, self->command) + self->preview, before->late_command, late);
    memcpy(hsep_at(self, self->x_pb) + self->preview, before->late_x, late);
    memcpy(
        hsep_at(self, self->e_h) + self->preview + self->late, before->residuals, (size_t)self->p * sizeof(hsep_real));
    for (hsep_int k = 0; k < self->preview; k++) {
        path[self->preview - 1 - k] = task->x_d[k] - self->start;
    }
    averaged_planner_command(self, task, rest, HSEP_N_DECIDED + self->n);
    const hsep_int pinned = hsep_planner_pinned(task->planner); /* they are published now */
    self->varied = self->late + (pinned > 0 ? pinned : 1);
    hsep_averaged_forecast(
        task->model, hsep_at(self, self->command), hsep_at(self, self->x_pb), path, self->preview,
        hsep_at(self, self->e_h), self->varied);
    self->judges = warm && task->model->predicted[HSEP_STATIC];
    self->follows = self->judges && best > 1 && self->paused == 0;
    self->paused -= self->paused > 0;
    if (best == 0) {
        averaged_planner_end(self);
    } else {
        self->stage = self->judges ? HSEP_AVERAGED_VARY : HSEP_AVERAGED_BEGIN;
    }
}

/* Some of the samples under the remainder of the last plan, and their variances. */
static void averaged_planner_vary(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_int all = self->late + self->preview, window = self->late + self->Np;
    const int is_within = self->varied < window;
    const hsep_int apart = is_within ? 1 : HSEP_NEWTON_APART, left = (is_within ? window : all) - self->varied;
    const hsep_int most = apart * HSEP_AVERAGED_VARIED, last = self->varied + (left < most ? left : most);
    hsep_averaged_go_on(task->model, hsep_at(self, self->x_pb), hsep_at(self, self->e_h), self->varied, last, apart);
    self->varied = last;
    if (last == all) {
        self->cost = self->unchanged = averaged_planner_cost(self, task, hsep_at(self, self->rest));
        self->stage = self->follows ? HSEP_AVERAGED_CHANGE : HSEP_AVERAGED_BEGIN;
    }
}

/* What linearisations of this window have in common. */
static void averaged_planner_change(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_linearised_change change = {
        .commands = hsep_splines_shape(splines), .n = 4 * splines->spacing, .passed = task->spline};
    hsep_linearised_begin((hsep_linearised *)hsep_at(self, self->linearised), task->model, &change);
    self->stage = HSEP_AVERAGED_BEGIN;
}

/* Begin a Newton step: slopes at the best plan, which was predicted last. */
static void averaged_planner_step(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    if (self->steps == 0) { /* the rest of the last plan was predicted before the physics model's plan */
        averaged_planner_command(self, task, hsep_at(self, self->rest), HSEP_N_DECIDED + self->n);
    }
    hsep_linearised_slopes(
        (hsep_linearised *)hsep_at(self, self->linearised), task->model, hsep_at(self, self->command),
        hsep_at(self, self->x_pb), averaged_planner_reaches[self->steps]);
    self->steps++;
    self->stage = HSEP_AVERAGED_AT;
}

/* Linearise with these slopes. */
static void averaged_planner_linearise(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    hsep_real *target = hsep_at(self, self->target);
    hsep_linearised_at((hsep_linearised *)hsep_at(self, self->linearised), task->model);
    for (hsep_int k = 0; k < self->preview; k++) { /* x_d - x_h, to which W c is added */
        const hsep_int j = self->preview - 1 - k;
        target[k] = task->x_d[k] - self->start - (x_pb[j] + e_h[j]);
    }
    self->columns = self->rows = self->n_pinned;
    self->part = self->tries = 0;
    self->stage = HSEP_AVERAGED_COLUMN;
}

/* Change of x_h by a spline; W is kept without the zeros before the splines begin. */
static hsep_real *averaged_planner_column_of(hsep_averaged_planner *self, hsep_int j, hsep_int spacing)
{
    const hsep_int first = self->n_pinned, i = j - first;
    return hsep_at(self, self->W) + (i * (self->preview - spacing * first) - spacing * (i * (i - 1) / 2));
}

/* A part of the changes of x_h by the next splines, as many as are computed side by side. */
static void averaged_planner_columns(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_int spacing = hsep_planner_splines(task->planner)->spacing, first = self->columns;
    const hsep_int left = self->n - first, count = left < HSEP_PHYSICS_ABREAST ? left : HSEP_PHYSICS_ABREAST;
    const hsep_real *at = hsep_at(self, self->best) + HSEP_N_DECIDED;
    hsep_real *columns[HSEP_PHYSICS_ABREAST] = {NULL}, *target = hsep_at(self, self->target);
    for (hsep_int c = 0; c < count; c++) {
        columns[c] = averaged_planner_column_of(self, first + c, spacing);
    }
    if (hsep_linearised_columns(
            (hsep_linearised *)hsep_at(self, self->linearised), task->model, self->part, first * spacing, spacing,
            count, columns)) {
        self->part++;
        return;
    }
    self->part = 0;
    for (hsep_int j = first; j < first + count; j++) {
        hsep_axpy(target + j * spacing, at[j], columns[j - first], self->preview - j * spacing);
    }
    self->columns += count;
    self->stage = self->columns < self->n ? HSEP_AVERAGED_COLUMN : HSEP_AVERAGED_PRODUCT;
}

/* Some rows of the programme of a Newton step, P = W' W + jerk_weight D' D, and of its linear term, for the splines
 * that are not pinned; the plan that is linearised at has the pinned ones in it. */
static void averaged_planner_products(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_int n = self->n, preview = self->preview, spacing = splines->spacing, first = self->n_pinned;
    const hsep_int begin = self->rows, end = begin + HSEP_AVERAGED_PRODUCTS < n ? begin + HSEP_AVERAGED_PRODUCTS : n;
    hsep_real *target = hsep_at(self, self->target), *v = hsep_planner_linear(task->planner);
    hsep_real *P = hsep_planner_quadratic(task->planner, begin);
    for (hsep_int i = begin; i < end; i++) {
        const hsep_real *left = averaged_planner_column_of(self, i, spacing);
        hsep_int j = i; /* column j begins (j - i) spacing later */
        for (; j + 4 <= n; j += 4, P += 4) {
            const hsep_real *rights[4]; /* from where the last of them begins */
            for (hsep_int c = 0; c < 4; c++) {
                rights[c] = averaged_planner_column_of(self, j + c, spacing) + (3 - c) * spacing;
            }
            hsep_dot_four(left + (j + 3 - i) * spacing, rights, preview - (j + 3) * spacing, P);
            for (hsep_int c = 0; c < 3; c++) {
                const hsep_int before = (3 - c) * spacing;
                P[c] += hsep_dot(left + (j + c - i) * spacing, rights[c] - before, before);
            }
        }
        for (; j < n; j++) {
            const hsep_real *right = averaged_planner_column_of(self, j, spacing);
            *P++ = hsep_dot(left + (j - i) * spacing, right, preview - j * spacing);
        }
        v[i - first] = hsep_dot(left, target + i * spacing, preview - i * spacing);
    }
    self->rows = end;
    if (end == n) {
        self->stage = HSEP_AVERAGED_FACTOR;
    }
}

/* Complete the programme of a Newton step, and factor it if it does not follow a bounded one. */
static void averaged_planner_factor(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_int first = self->n_pinned;
    const hsep_real jerk_weight = task->planner->jerk_weight;
    hsep_splines_difference_gram(
        splines, 3, jerk_weight, self->n - first, hsep_planner_quadratic(task->planner, first));
    hsep_splines_project_jerk(
        splines, jerk_weight, hsep_planner_third(task->planner), first, hsep_planner_linear(task->planner));
    hsep_planner_regularise(task->planner, first);
    const int begins = self->bounded || hsep_planner_factor(task->planner, 1);
    self->stage = begins ? HSEP_AVERAGED_SOLVE : HSEP_AVERAGED_COMPARE;
}

/* Solve it. */
static void averaged_planner_solve(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_tolerance tolerance = averaged_planner_tolerance(self->steps);
    if (self->bounded) { /* so it is again */
        hsep_planner_solve_again(task->planner, hsep_at(self, self->best), &tolerance);
        self->stage = HSEP_AVERAGED_BOUNDED;
        return;
    }
    const hsep_plan_status status = hsep_planner_solve(task->planner, 1, &tolerance);
    self->bounded = status == HSEP_PLAN_BOUNDED;
    self->stage = HSEP_AVERAGED_COMPARE;
    if (status != HSEP_PLAN_FAILED) {
        self->stage = status == HSEP_PLAN_DONE ? HSEP_AVERAGED_JUDGE : HSEP_AVERAGED_BOUNDED;
    }
}

/* Judge a length of a step, whose end the planner has, and take it if it is better; otherwise a shorter one is tried.
 */
static void averaged_planner_judge(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    hsep_real *c = hsep_planner_coefficients(task->planner), *best = hsep_at(self, self->best);
    const hsep_real cost = averaged_planner_cost(self, task, c), gain = self->cost - cost;
    self->tries++;
    self->stage = HSEP_AVERAGED_COMPARE;
    if (averaged_planner_better(cost, self->cost)) {
        const int is_last = gain < HSEP_NEWTON_GAIN * (gain + cost) || self->steps == HSEP_AVERAGED_STEPS;
        averaged_planner_copy(self, best, c);
        self->cost = cost;
        self->stage = is_last ? HSEP_AVERAGED_COMPARE : HSEP_AVERAGED_STEP;
        averaged_planner_copy(self, c, hsep_at(self, self->rest));
    } else if (self->tries < HSEP_AVERAGED_TRIES) {
        const hsep_real shorter = averaged_planner_lengths[self->tries] / averaged_planner_lengths[self->tries - 1];
        for (hsep_int j = HSEP_N_DECIDED; j < HSEP_N_DECIDED + self->n; j++) {
            c[j] = best[j] + shorter * (c[j] - best[j]);
        }
        self->stage = HSEP_AVERAGED_JUDGE;
    }
}

/* Share of a window in which a plan is at the bound of the change. */
static hsep_real averaged_planner_bounded(
    const hsep_averaged_planner *self, const hsep_splines *splines, const hsep_real c[])
{
    const hsep_int count = HSEP_N_DECIDED + self->n;
    hsep_real bounded = 0.0;
    for (hsep_int k = 0; k < self->Np; k++) {
        bounded += hsep_fabs(hsep_splines_sum(splines, c, count, k)) * splines->share[0] > HSEP_PLANNING_AT_BOUND;
    }
    return bounded / (hsep_real)self->Np;
}

/* Whether the best plan asks for a larger change than compensation is made for. A motor at its limit does not follow,
 * so that the next plan asks for more. A position loop that is driven so far may fall into a second state with an error
 * many times larger, and stays in it when compensation ends. */
static int averaged_planner_runs_away(const hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_real error = hsep_sqrt(self->cost / (hsep_real)self->preview) * splines->share[0];
    const hsep_real longer = averaged_planner_bounded(self, splines, hsep_at_const(self, self->best)) -
                             averaged_planner_bounded(self, splines, hsep_at_const(self, self->of_physics));
    return error > HSEP_PLANNING_LEFT && longer > HSEP_PLANNING_BOUND_SHARE;
}

/* Take the plan whose cost is lowest. */
static void averaged_planner_compare(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_real cost = averaged_planner_cost(self, task, hsep_at(self, self->of_physics));
    hsep_int plan = averaged_planner_better(self->unchanged, cost) ? self->rest : self->of_physics;
    self->planned = plan == self->of_physics;
    if (self->follows && averaged_planner_better(self->cost, cost)) {
        if (averaged_planner_runs_away(self, task)) {
            self->paused = self->pause;
            self->pause *= 2;
        } else {
            plan = self->best;
            self->planned = 2;
        }
    }
    averaged_planner_copy(self, hsep_planner_coefficients(task->planner), hsep_at(self, plan));
    averaged_planner_end(self);
}

HSEP_API void hsep_averaged_planner_advance(hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    switch ((hsep_averaged_stage)self->stage) {
    case HSEP_AVERAGED_DONE:
        break;
    case HSEP_AVERAGED_VARY:
        averaged_planner_vary(self, task);
        break;
    case HSEP_AVERAGED_CHANGE:
        averaged_planner_change(self, task);
        break;
    case HSEP_AVERAGED_BEGIN:
        averaged_planner_physics(self, task);
        break;
    case HSEP_AVERAGED_AIM:
        averaged_planner_aim(self, task);
        break;
    case HSEP_AVERAGED_AIMED:
        if (hsep_planner_factor(task->planner, 1)) {
            self->stage = HSEP_AVERAGED_FACTORED;
        } else {
            averaged_planner_end(self);
        }
        break;
    case HSEP_AVERAGED_FACTORED:
        averaged_planner_solve_physics(self, task);
        break;
    case HSEP_AVERAGED_PHYSICS:
        if (hsep_planner_advance(task->planner)) {
            averaged_planner_continue(self, task);
        }
        break;
    case HSEP_AVERAGED_STEP:
        averaged_planner_step(self, task);
        break;
    case HSEP_AVERAGED_AT:
        averaged_planner_linearise(self, task);
        break;
    case HSEP_AVERAGED_COLUMN:
        averaged_planner_columns(self, task);
        break;
    case HSEP_AVERAGED_PRODUCT:
        averaged_planner_products(self, task);
        break;
    case HSEP_AVERAGED_FACTOR:
        averaged_planner_factor(self, task);
        break;
    case HSEP_AVERAGED_SOLVE:
        averaged_planner_solve(self, task);
        break;
    case HSEP_AVERAGED_BOUNDED:
        if (hsep_planner_advance(task->planner)) {
            self->stage = HSEP_AVERAGED_JUDGE;
        }
        break;
    case HSEP_AVERAGED_JUDGE:
        if (averaged_planner_predicts(self, task, hsep_planner_coefficients(task->planner))) {
            averaged_planner_judge(self, task);
        }
        break;
    case HSEP_AVERAGED_COMPARE:
        if (averaged_planner_predicts(self, task, hsep_at(self, self->of_physics))) {
            averaged_planner_compare(self, task);
        }
        break;
    case HSEP_AVERAGED_PREDICT:
        averaged_planner_window(self, task);
        break;
    }
}

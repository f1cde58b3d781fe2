#include "hsep_trusted_planner.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>
#include <string.h>

static const hsep_real trusted_planner_reaches[] = {HSEP_NEWTON_REACHES};
static const hsep_real trusted_planner_lengths[] = {HSEP_NEWTON_LENGTHS};
static const hsep_word trusted_planner_solved[] = {HSEP_NEWTON_SOLVED};

HSEP_ASSERT(reaches, sizeof trusted_planner_reaches == HSEP_TRUSTED_STEPS * sizeof(hsep_real));
HSEP_ASSERT(lengths, sizeof trusted_planner_lengths == HSEP_TRUSTED_TRIES * sizeof(hsep_real));
HSEP_ASSERT(solved, sizeof trusted_planner_solved == (1 + HSEP_TRUSTED_STEPS) * sizeof(hsep_word));

/* Where the solver of a programme ends: of the physics model's plan, 0, or of a Newton step. In single precision
 * rounding leaves up to 2e-4 of a bound of third differences, so that the margin is wider. */
static hsep_tolerance trusted_planner_tolerance(hsep_word programme)
{
    hsep_tolerance tolerance = {HSEP_NEWTON_TOLERANCE};
#ifdef HSEP_FLOAT32
    tolerance.margin = 1e-4F;
#endif
    tolerance.steps = trusted_planner_solved[programme];
    return tolerance;
}

/* Whether a plan costs less than another; not if it is NaN. */
static int trusted_planner_better(hsep_real cost, hsep_real other)
{
    return cost < (1.0 - HSEP_NEWTON_LEAST_GAIN) * other;
}

static void trusted_planner_copy(hsep_trusted_planner *self, hsep_real to[], const hsep_real from[])
{
    memcpy(to, from, (size_t)(HSEP_N_DECIDED + self->n) * sizeof(hsep_real));
}

/* Commands under the first count coefficients of a plan, and the response of the physics model to them. */
static void trusted_planner_command(
    hsep_trusted_planner *self, const hsep_trusted_task *task, const hsep_real c[], hsep_word count)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    hsep_real *command = hsep_at(self, self->command), *x_pb = hsep_at(self, self->x_pb);
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    memcpy(trial, hsep_at(self, self->physics), (size_t)(self->trial - self->physics) * sizeof(hsep_real));
    for (hsep_word k = 0; k < self->preview; k++) {
        const hsep_word j = self->preview - 1 - k;
        command[j] = task->x_d[k] - self->start + hsep_splines_sum(splines, c, count, k);
        hsep_physics_forced_response(trial, &command[j], &x_pb[j], 1);
    }
}

/* Predict the commands of a plan in two calls, with the variances under the remainder of the last plan; return
 * whether all are predicted. */
static int trusted_planner_predicts(hsep_trusted_planner *self, const hsep_trusted_task *task, const hsep_real c[])
{
    const hsep_word all = self->preview + self->late;
    hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    if (self->predicted == 0) {
        self->predicted = all / HSEP_TRUSTED_AT_FIRST;
        trusted_planner_command(self, task, c, HSEP_N_DECIDED + self->n);
        hsep_trusted_predict(task->model, hsep_at(self, self->command), x_pb, e_h, self->predicted, 0);
        return 0;
    }
    hsep_trusted_go_on(task->model, x_pb, e_h, self->predicted, all, 0);
    self->predicted = 0;
    return 1;
}

/* Cost of the plan that was predicted last, m2; not finite if the prediction overflows. */
static hsep_real trusted_planner_cost(
    const hsep_trusted_planner *self, const hsep_trusted_task *task, const hsep_real c[])
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_word count = HSEP_N_DECIDED + self->n;
    const hsep_real *x_pb = hsep_at_const(self, self->x_pb), *e_h = hsep_at_const(self, self->e_h);
    const hsep_real *before = task->planner->delta_before;
    hsep_real d[4] = {before[0], before[1], before[2], 0.0}, error = 0.0, jerk = 0.0;
    for (hsep_word k = 0; k < self->preview; k++) {
        const hsep_word j = self->preview - 1 - k;
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
static void trusted_planner_end(hsep_trusted_planner *self)
{
    self->predicted = 0;
    self->stage = HSEP_TRUSTED_PREDICT;
}

/* Some of the window's samples under the plan, and their variances. */
static void trusted_planner_window(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_word first = self->predicted, all = self->late + self->Np, left = all - first;
    const hsep_word last = first + (left < HSEP_TRUSTED_VARIED ? left : HSEP_TRUSTED_VARIED);
    hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    if (first == 0) {
        trusted_planner_command(self, task, hsep_planner_coefficients(task->planner), HSEP_N_DECIDED + self->n);
        hsep_trusted_predict(task->model, hsep_at(self, self->command), x_pb, e_h, last, 1);
    } else {
        hsep_trusted_go_on(task->model, x_pb, e_h, first, last, 1);
    }
    self->predicted = last;
    self->stage = last < all ? HSEP_TRUSTED_PREDICT : HSEP_TRUSTED_DONE;
}

/* The physics model's plan is made: try a better one, if there may be one. */
static void trusted_planner_continue(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    hsep_real *c = hsep_planner_coefficients(task->planner), *rest = hsep_at(self, self->rest);
    self->planned = 1;
    if (!self->follows) {
        trusted_planner_end(self);
    } else {
        self->stage = HSEP_TRUSTED_STEP;
        trusted_planner_copy(self, hsep_at(self, self->of_physics), c);
        trusted_planner_copy(self, hsep_at(self, self->best), rest);
        trusted_planner_copy(self, c, rest);
        hsep_planner_let_turn(task->planner);
        hsep_planner_decide_pinned(task->planner);
    }
}

/* Begin the physics model's plan. */
static void trusted_planner_physics(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb);
    hsep_real *target = hsep_at(self, self->target); /* x_d minus its response to x_d with what is decided of delta */
    trusted_planner_command(self, task, hsep_at(self, self->rest), HSEP_N_DECIDED);
    for (hsep_word k = 0; k < self->preview; k++) {
        target[k] = task->x_d[k] - self->start - x_pb[self->preview - 1 - k];
    }
    hsep_planner_open(task->planner, task->x_d);
    self->stage = HSEP_TRUSTED_AIM;
}

/* Make its programme. */
static void trusted_planner_aim(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    hsep_planner_aim(task->planner, task->spline, hsep_at(self, self->target));
    hsep_planner_pin(task->planner);
    self->stage = HSEP_TRUSTED_AIMED;
}

/* Solve it; without one the remainder of the last plan goes on. */
static void trusted_planner_solve_physics(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_tolerance tolerance = trusted_planner_tolerance(0);
    const hsep_plan_status status = hsep_planner_solve(task->planner, 1, &tolerance);
    if (status == HSEP_PLAN_DONE) {
        trusted_planner_continue(self, task);
    } else if (status == HSEP_PLAN_BOUNDED) {
        self->stage = HSEP_TRUSTED_PHYSICS;
    } else {
        trusted_planner_end(self);
    }
}

HSEP_API void hsep_trusted_planner_begin(
    hsep_trusted_planner *self, const hsep_trusted_task *task, const hsep_trusted_before *before, hsep_word best)
{
    const size_t late = (size_t)self->late * sizeof(hsep_real);
    hsep_real *path = hsep_at(self, self->target), *rest = hsep_at(self, self->rest);
    self->steps = self->tries = self->planned = self->predicted = self->bounded = 0;
    trusted_planner_copy(self, rest, hsep_planner_coefficients(task->planner));
    memcpy(hsep_at(self, self->physics), before->physics, (size_t)(self->trial - self->physics) * sizeof(hsep_real));
    memcpy(hsep_at(self, self->command) + self->preview, before->late_command, late);
    memcpy(hsep_at(self, self->x_pb) + self->preview, before->late_x, late);
    memcpy(
        hsep_at(self, self->e_h) + self->preview + self->late, before->residuals, (size_t)self->p * sizeof(hsep_real));
    for (hsep_word k = 0; k < self->preview; k++) {
        path[self->preview - 1 - k] = task->x_d[k] - self->start;
    }
    trusted_planner_command(self, task, rest, HSEP_N_DECIDED + self->n);
    const hsep_word pinned = hsep_planner_pinned(task->planner); /* they are published now */
    self->varied = self->late + (pinned > 0 ? pinned : 1);
    hsep_trusted_forecast(
        task->model, hsep_at(self, self->command), hsep_at(self, self->x_pb), path, self->preview,
        hsep_at(self, self->e_h), self->varied);
    self->follows = best > 1 && !self->ended && task->model->predicted[HSEP_STATIC];
    if (best == 0) {
        trusted_planner_end(self);
    } else {
        self->stage = self->follows ? HSEP_TRUSTED_VARY : HSEP_TRUSTED_BEGIN;
    }
}

/* Some of the samples under the remainder of the last plan, and their variances. */
static void trusted_planner_vary(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_word all = self->late + self->preview, window = self->late + self->Np;
    const int is_within = self->varied < window;
    const hsep_word apart = is_within ? 1 : HSEP_NEWTON_APART, left = (is_within ? window : all) - self->varied;
    const hsep_word most = apart * HSEP_TRUSTED_VARIED, last = self->varied + (left < most ? left : most);
    hsep_trusted_go_on(task->model, hsep_at(self, self->x_pb), hsep_at(self, self->e_h), self->varied, last, apart);
    self->varied = last;
    if (last == all) {
        self->cost = trusted_planner_cost(self, task, hsep_at(self, self->rest));
        self->stage = HSEP_TRUSTED_CHANGE;
    }
}

/* What linearisations of this window have in common. */
static void trusted_planner_change(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_linearised_change change = {
        .commands = hsep_splines_shape(splines), .n = 4 * splines->spacing, .passed = task->spline};
    hsep_linearised_begin((hsep_linearised *)hsep_at(self, self->linearised), task->model, &change);
    self->stage = HSEP_TRUSTED_BEGIN;
}

/* Begin a Newton step: slopes at the best plan, which was predicted last. */
static void trusted_planner_step(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    if (self->steps == 0) { /* the rest of the last plan was predicted before the physics model's plan */
        trusted_planner_command(self, task, hsep_at(self, self->rest), HSEP_N_DECIDED + self->n);
    }
    hsep_linearised_slopes(
        (hsep_linearised *)hsep_at(self, self->linearised), task->model, hsep_at(self, self->command),
        hsep_at(self, self->x_pb), trusted_planner_reaches[self->steps]);
    self->steps++;
    self->stage = HSEP_TRUSTED_AT;
}

/* Linearise with these slopes. */
static void trusted_planner_linearise(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    hsep_real *target = hsep_at(self, self->target);
    hsep_linearised_at((hsep_linearised *)hsep_at(self, self->linearised), task->model);
    for (hsep_word k = 0; k < self->preview; k++) { /* x_d - x_h, to which W c is added */
        const hsep_word j = self->preview - 1 - k;
        target[k] = task->x_d[k] - self->start - (x_pb[j] + e_h[j]);
    }
    self->columns = self->rows = self->n_pinned;
    self->part = self->tries = 0;
    self->stage = HSEP_TRUSTED_COLUMN;
}

/* Change of x_h by a spline; W is kept without the zeros before the splines begin. */
static hsep_real *trusted_planner_column_of(hsep_trusted_planner *self, hsep_word j, hsep_word spacing)
{
    const hsep_word first = self->n_pinned, i = j - first;
    return hsep_at(self, self->W) + (i * (self->preview - spacing * first) - spacing * (i * (i - 1) / 2));
}

/* A part of the changes of x_h by the next splines, as many as are computed side by side. */
static void trusted_planner_columns(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_word spacing = hsep_planner_splines(task->planner)->spacing, first = self->columns;
    const hsep_word left = self->n - first, count = left < HSEP_PHYSICS_ABREAST ? left : HSEP_PHYSICS_ABREAST;
    const hsep_real *at = hsep_at(self, self->best) + HSEP_N_DECIDED;
    hsep_real *columns[HSEP_PHYSICS_ABREAST] = {NULL}, *target = hsep_at(self, self->target);
    for (hsep_word c = 0; c < count; c++) {
        columns[c] = trusted_planner_column_of(self, first + c, spacing);
    }
    if (hsep_linearised_columns(
            (hsep_linearised *)hsep_at(self, self->linearised), task->model, self->part, first * spacing, spacing,
            count, columns)) {
        self->part++;
        return;
    }
    self->part = 0;
    for (hsep_word j = first; j < first + count; j++) {
        hsep_axpy(target + j * spacing, at[j], columns[j - first], self->preview - j * spacing);
    }
    self->columns += count;
    self->stage = self->columns < self->n ? HSEP_TRUSTED_COLUMN : HSEP_TRUSTED_PRODUCT;
}

/* Some rows of the programme of a Newton step, P = W' W + jerk_weight D' D, and of its linear term, for the splines
 * that are not pinned; the plan that is linearised at has the pinned ones in it. */
static void trusted_planner_products(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_word n = self->n, preview = self->preview, spacing = splines->spacing, first = self->n_pinned;
    const hsep_word begin = self->rows, end = begin + HSEP_TRUSTED_PRODUCTS < n ? begin + HSEP_TRUSTED_PRODUCTS : n;
    hsep_real *target = hsep_at(self, self->target), *v = hsep_planner_linear(task->planner);
    hsep_real *P = hsep_planner_quadratic(task->planner, begin);
    for (hsep_word i = begin; i < end; i++) {
        const hsep_real *left = trusted_planner_column_of(self, i, spacing);
        hsep_word j = i; /* column j begins (j - i) spacing later */
        for (; j + 4 <= n; j += 4, P += 4) {
            const hsep_real *rights[4]; /* from where the last of them begins */
            for (hsep_word c = 0; c < 4; c++) {
                rights[c] = trusted_planner_column_of(self, j + c, spacing) + (3 - c) * spacing;
            }
            hsep_dot_four(left + (j + 3 - i) * spacing, rights, preview - (j + 3) * spacing, P);
            for (hsep_word c = 0; c < 3; c++) {
                const hsep_word before = (3 - c) * spacing;
                P[c] += hsep_dot(left + (j + c - i) * spacing, rights[c] - before, before);
            }
        }
        for (; j < n; j++) {
            const hsep_real *right = trusted_planner_column_of(self, j, spacing);
            *P++ = hsep_dot(left + (j - i) * spacing, right, preview - j * spacing);
        }
        v[i - first] = hsep_dot(left, target + i * spacing, preview - i * spacing);
    }
    self->rows = end;
    if (end == n) {
        self->stage = HSEP_TRUSTED_FACTOR;
    }
}

/* Complete the programme of a Newton step, and factor it if it does not follow a bounded one. */
static void trusted_planner_factor(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_word first = self->n_pinned;
    const hsep_real jerk_weight = task->planner->jerk_weight;
    hsep_splines_difference_gram(
        splines, 3, jerk_weight, self->n - first, hsep_planner_quadratic(task->planner, first));
    hsep_splines_project_jerk(
        splines, jerk_weight, hsep_planner_third(task->planner), first, hsep_planner_linear(task->planner));
    hsep_planner_regularise(task->planner, first);
    const int begins = self->bounded || hsep_planner_factor(task->planner, 1);
    self->stage = begins ? HSEP_TRUSTED_SOLVE : HSEP_TRUSTED_COMPARE;
}

/* Solve it. */
static void trusted_planner_solve(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_tolerance tolerance = trusted_planner_tolerance(self->steps);
    if (self->bounded) { /* so it is again */
        hsep_planner_solve_again(task->planner, hsep_at(self, self->best), &tolerance);
        self->stage = HSEP_TRUSTED_BOUNDED;
        return;
    }
    const hsep_plan_status status = hsep_planner_solve(task->planner, 1, &tolerance);
    self->bounded = status == HSEP_PLAN_BOUNDED;
    self->stage = HSEP_TRUSTED_COMPARE;
    if (status != HSEP_PLAN_FAILED) {
        self->stage = status == HSEP_PLAN_DONE ? HSEP_TRUSTED_JUDGE : HSEP_TRUSTED_BOUNDED;
    }
}

/* Judge a length of a step, whose end the planner has, and take it if it is better; otherwise a shorter one is tried.
 */
static void trusted_planner_judge(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    hsep_real *c = hsep_planner_coefficients(task->planner), *best = hsep_at(self, self->best);
    const hsep_real cost = trusted_planner_cost(self, task, c), gain = self->cost - cost;
    self->tries++;
    self->stage = HSEP_TRUSTED_COMPARE;
    if (trusted_planner_better(cost, self->cost)) {
        const int is_last = gain < HSEP_NEWTON_GAIN * (gain + cost) || self->steps == HSEP_TRUSTED_STEPS;
        trusted_planner_copy(self, best, c);
        self->cost = cost;
        self->stage = is_last ? HSEP_TRUSTED_COMPARE : HSEP_TRUSTED_STEP;
        trusted_planner_copy(self, c, hsep_at(self, self->rest));
    } else if (self->tries < HSEP_TRUSTED_TRIES) {
        const hsep_real shorter = trusted_planner_lengths[self->tries] / trusted_planner_lengths[self->tries - 1];
        for (hsep_word j = HSEP_N_DECIDED; j < HSEP_N_DECIDED + self->n; j++) {
            c[j] = best[j] + shorter * (c[j] - best[j]);
        }
        self->stage = HSEP_TRUSTED_JUDGE;
    }
}

/* Share of a window in which a plan is at the bound of the change. */
static hsep_real trusted_planner_bounded(
    const hsep_trusted_planner *self, const hsep_splines *splines, const hsep_real c[])
{
    const hsep_word count = HSEP_N_DECIDED + self->n;
    hsep_real bounded = 0.0;
    for (hsep_word k = 0; k < self->Np; k++) {
        bounded += hsep_fabs(hsep_splines_sum(splines, c, count, k)) * splines->share[0] > HSEP_NEWTON_AT_BOUND;
    }
    return bounded / (hsep_real)self->Np;
}

/* Whether the best plan asks for a larger change than compensation is made for. A motor at its limit does not follow,
 * so that the next plan asks for more. A position loop that is driven so far may fall into a second state with an error
 * many times larger, and stays in it when compensation ends. */
static int trusted_planner_runs_away(const hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    const hsep_real error = hsep_sqrt(self->cost / (hsep_real)self->preview) * splines->share[0];
    const hsep_real longer = trusted_planner_bounded(self, splines, hsep_at_const(self, self->best)) -
                             trusted_planner_bounded(self, splines, hsep_at_const(self, self->of_physics));
    return error > HSEP_NEWTON_LEFT && longer > HSEP_NEWTON_BOUND_SHARE;
}

/* Take the plan whose cost is lower. */
static void trusted_planner_compare(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_real cost = trusted_planner_cost(self, task, hsep_at(self, self->of_physics));
    int is_better = trusted_planner_better(self->cost, cost);
    if (is_better && trusted_planner_runs_away(self, task)) {
        self->ended = 1;
        is_better = 0;
    }
    self->planned = is_better ? 2 : 1;
    trusted_planner_copy(
        self, hsep_planner_coefficients(task->planner), hsep_at(self, is_better ? self->best : self->of_physics));
    trusted_planner_end(self);
}

HSEP_API void hsep_trusted_planner_advance(hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    switch ((hsep_trusted_stage)self->stage) {
    case HSEP_TRUSTED_DONE:
        break;
    case HSEP_TRUSTED_VARY:
        trusted_planner_vary(self, task);
        break;
    case HSEP_TRUSTED_CHANGE:
        trusted_planner_change(self, task);
        break;
    case HSEP_TRUSTED_BEGIN:
        trusted_planner_physics(self, task);
        break;
    case HSEP_TRUSTED_AIM:
        trusted_planner_aim(self, task);
        break;
    case HSEP_TRUSTED_AIMED:
        if (hsep_planner_factor(task->planner, 1)) {
            self->stage = HSEP_TRUSTED_FACTORED;
        } else {
            trusted_planner_end(self);
        }
        break;
    case HSEP_TRUSTED_FACTORED:
        trusted_planner_solve_physics(self, task);
        break;
    case HSEP_TRUSTED_PHYSICS:
        if (hsep_planner_advance(task->planner)) {
            trusted_planner_continue(self, task);
        }
        break;
    case HSEP_TRUSTED_STEP:
        trusted_planner_step(self, task);
        break;
    case HSEP_TRUSTED_AT:
        trusted_planner_linearise(self, task);
        break;
    case HSEP_TRUSTED_COLUMN:
        trusted_planner_columns(self, task);
        break;
    case HSEP_TRUSTED_PRODUCT:
        trusted_planner_products(self, task);
        break;
    case HSEP_TRUSTED_FACTOR:
        trusted_planner_factor(self, task);
        break;
    case HSEP_TRUSTED_SOLVE:
        trusted_planner_solve(self, task);
        break;
    case HSEP_TRUSTED_BOUNDED:
        if (hsep_planner_advance(task->planner)) {
            self->stage = HSEP_TRUSTED_JUDGE;
        }
        break;
    case HSEP_TRUSTED_JUDGE:
        if (trusted_planner_predicts(self, task, hsep_planner_coefficients(task->planner))) {
            trusted_planner_judge(self, task);
        }
        break;
    case HSEP_TRUSTED_COMPARE:
        if (trusted_planner_predicts(self, task, hsep_at(self, self->of_physics))) {
            trusted_planner_compare(self, task);
        }
        break;
    case HSEP_TRUSTED_PREDICT:
        trusted_planner_window(self, task);
        break;
    }
}

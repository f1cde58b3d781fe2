#include "hsep_newton.h"

#include "hsep_cholesky.h"
#include "hsep_linearised.h"

static const hsep_real newton_lengths[] = {HSEP_NEWTON_LENGTHS};

HSEP_ASSERT(lengths, sizeof newton_lengths == HSEP_NEWTON_TRIES * sizeof(hsep_real));

HSEP_API hsep_real hsep_newton_lay_out(hsep_newton *self, const hsep_predictor_parameters *parameters)
{
    const hsep_knots knots = hsep_planner_knots(parameters);
    const hsep_int spacing = parameters->compensator.spacing, n = hsep_splines_count(parameters->horizon, spacing);
    const hsep_real all = (hsep_real)hsep_predicted(parameters), horizon = (hsep_real)parameters->horizon;
    const hsep_real filter = hsep_physics_lay_out(&(hsep_physics){0}, parameters), m = (hsep_real)knots.m;
    const hsep_real coefficients = HSEP_N_DECIDED + (hsep_real)n;
    hsep_real end = HSEP_WORDS(hsep_newton);
    self->horizon = parameters->horizon;
    self->late = hsep_late(&parameters->settings);
    self->Np = parameters->settings.Np;
    self->n = n;
    self->m = knots.m;
    const int few = (n - knots.n) * spacing < HSEP_NEWTON_TWICE;
    self->n_steps = few ? 1 : HSEP_NEWTON_THRICE * self->Np <= self->horizon ? 2 : 3;
    self->remainder = hsep_take(&end, coefficients);
    self->best = hsep_take(&end, coefficients);
    self->of_physics = hsep_take(&end, coefficients);
    self->command = hsep_take(&end, all);
    self->x_pb = hsep_take(&end, all);
    self->e_h = hsep_take(&end, all + (hsep_real)parameters->settings.p);
    self->target = hsep_take(&end, horizon);
    self->weight = hsep_take(&end, horizon);
    self->corrected = hsep_take(&end, (hsep_real)n);
    self->begins = hsep_take(&end, m);
    self->shapes = hsep_take(&end, HSEP_KNOTS_LEVELS * horizon);
    self->passed = hsep_take(&end, HSEP_KNOTS_LEVELS * horizon);
    self->gram = hsep_take(&end, hsep_triangle(knots.m));
    self->W = hsep_take(&end, m * horizon);
    self->linearised = hsep_take_block(&end, hsep_linearised_lay_out(&(hsep_linearised){0}, parameters));
    self->physics = hsep_take_block(&end, filter); /* up to trial, which tells its size */
    self->trial = hsep_take_block(&end, filter);
    return end * sizeof(hsep_real);
}

/* Whether a plan costs less than another; not if it is NaN. */
static int newton_better(hsep_real cost, hsep_real other) { return cost < (1.0 - HSEP_NEWTON_LEAST_GAIN) * other; }

static void newton_copy(hsep_newton *self, hsep_real to[], const hsep_real from[])
{
    hsep_copy(to, from, HSEP_N_DECIDED + self->n);
}

/* Commands under the first count coefficients of a plan, and the response of the physics model to them. */
static void newton_command(hsep_newton *self, const hsep_newton_task *task, const hsep_real c[], hsep_int count)
{
    const hsep_splines *splines = hsep_planner_splines(task->planner);
    hsep_real *command = hsep_at(self, self->command), *x_pb = hsep_at(self, self->x_pb);
    hsep_physics *trial = hsep_part(self, self->trial);
    hsep_copy(trial, hsep_at(self, self->physics), self->trial - self->physics);
    for (hsep_int k = 0; k < self->horizon; k++) {
        const hsep_int j = self->horizon - 1 - k;
        command[j] = task->x_d[k] - task->predictor->start + hsep_splines_sum(splines, c, count, k) + task->load[k];
        x_pb[j] = hsep_physics_respond(trial, command[j]);
    }
}

/* Whether the unmodified commands, and the physics model's answer, outgrow what is learned by HSEP_PLANNING_FASTER:
 * in their largest change from sample to sample over the plan and the late samples. */
static int newton_outgrows(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_int n = self->horizon + self->late;
    newton_command(self, task, hsep_at(self, self->remainder), 0);
    const hsep_real of_command = hsep_largest_step(hsep_at(self, self->command), n);
    const hsep_real of_model = hsep_largest_step(hsep_at(self, self->x_pb), n);
    return !(hsep_fmin(of_command, of_model) <= HSEP_PLANNING_FASTER * task->model->learned.fastest);
}

/* target := weighted x_d - x_h of the plan that was predicted last, m; return the sum of their squares. */
static hsep_real newton_errors(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    const hsep_real *weight = hsep_at(self, self->weight);
    hsep_real *target = hsep_at(self, self->target), squares = 0.0;
    for (hsep_int k = 0; k < self->horizon; k++) {
        const hsep_int j = self->horizon - 1 - k;
        target[k] = weight[k] * (task->x_d[k] - task->predictor->start - (x_pb[j] + e_h[j]));
        squares += target[k] * target[k];
    }
    return squares;
}

/* Cost of the plan that was predicted last, m2; not finite if the prediction overflows. */
static hsep_real newton_cost(hsep_newton *self, const hsep_newton_task *task, const hsep_real c[])
{
    const hsep_real error = newton_errors(self, task);
    return error + hsep_planner_jerk(task->planner, c, hsep_at(self, self->target));
}

/* Variance of the plan that was predicted last with variances, over all of it, weighted as its errors, m2. */
static hsep_real newton_doubt(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_real *weight = hsep_at(self, self->weight), *variance = hsep_at(task->model, task->model->variance);
    hsep_real sum = 0.0;
    for (hsep_int k = 0; k < self->horizon; k++) {
        sum += weight[k] * weight[k] * variance[self->horizon - 1 - k];
    }
    return sum;
}

/* Samples that the splines begin with, which are solved for. */
static hsep_int *newton_begins(hsep_newton *self) { return hsep_part(self, self->begins); }

/* A spline with this distance of knots, or filtered by G_pb, (horizon,), of shapes or passed. */
static hsep_real *newton_level(hsep_newton *self, hsep_int of, hsep_int level)
{
    return hsep_at(self, of) + level * self->horizon;
}

/* Begin the physics model's plan at the remainder of the last one, which was predicted last: W' W, W' error. */
static void newton_open(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_real *x_pb = hsep_at(self, self->x_pb), *weight = hsep_at(self, self->weight);
    hsep_real *target = hsep_at(self, self->target), *v = hsep_planner_linear(task->planner);
    const hsep_real change = hsep_averaged_doubts(task->model) ? 1.0 : self->bound;
    hsep_planner_open(task->planner, task->x_d, self->is_physics ? self->horizon : 0, change);
    for (hsep_int k = 0; k < self->horizon; k++) {
        target[k] = weight[k] * weight[k] * (task->x_d[k] - task->predictor->start - x_pb[self->horizon - 1 - k]);
    }
    for (hsep_int i = 0; i < self->m; i++) {
        const hsep_int level = hsep_knots_at(&task->planner->knots, i).level, begin = newton_begins(self)[i];
        v[i] = hsep_dot(newton_level(self, self->passed, level), target + begin, self->horizon - begin);
    }
    hsep_copy(hsep_planner_quadratic(task->planner), hsep_at(self, self->gram), (hsep_int)hsep_triangle(self->m));
    hsep_planner_complete(task->planner, task->planner->jerk_weight);
}

/* Splines, from one on, whose changes of x_h are computed side by side: they have the same distance of knots. */
static hsep_int newton_together(const hsep_planner *planner, hsep_int first)
{
    return hsep_min(hsep_knots_at(&planner->knots, first).last + 1 - first, HSEP_PHYSICS_ABREAST);
}

/* Weighted changes of x_h by the next splines; the first of a distance of knots begins the linearisation. */
static void newton_columns(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_int first = self->spline, count = newton_together(task->planner, first);
    const hsep_int spacing = hsep_planner_splines(task->planner)->spacing;
    const hsep_real *weight = hsep_at(self, self->weight);
    hsep_linearised *linearised = hsep_part(self, self->linearised);
    hsep_real *columns[HSEP_PHYSICS_ABREAST] = {NULL};
    const hsep_knot knot = hsep_knots_at(&task->planner->knots, first);
    const hsep_int distance = spacing << knot.level, from = newton_begins(self)[first];
    if (first == knot.first) {
        hsep_linearised_begin(
            linearised, task->model, newton_level(self, self->shapes, knot.level),
            newton_level(self, self->passed, knot.level), 4 * distance);
    }
    for (hsep_int c = 0; c < count; c++) {
        columns[c] = hsep_at(self, self->W) + ((first + c) * self->horizon + from + c * distance);
    }
    hsep_linearised_columns(linearised, task->model, from, distance, count, columns);
    for (hsep_int c = 0; c < count; c++) {
        for (hsep_int k = from + c * distance; k < self->horizon; k++) {
            columns[c][k - from - c * distance] *= weight[k];
        }
    }
    self->spline += count;
}

/* The programme of a Newton step, P = W' W, and its linear term. */
static void newton_products(hsep_newton *self, hsep_planner *planner)
{
    const hsep_int m = self->m, horizon = self->horizon, *begins = newton_begins(self);
    const hsep_real *W = hsep_at(self, self->W), *target = hsep_at(self, self->target), *rights[4];
    hsep_real *v = hsep_planner_linear(planner), *P = hsep_planner_quadratic(planner), sums[4];
    for (hsep_int i = 0; i < m; i++) {
        for (hsep_int j = i, count; j < m; j += count) {
            const hsep_int from = begins[j] > begins[i] ? begins[j] : begins[i]; /* both have begun */
            count = newton_together(planner, j);
            for (hsep_int c = 0; c < 4; c++) {
                rights[c] = W + ((c < count ? j + c : j) * horizon + from);
            }
            hsep_dot_four(W + (i * horizon + from), rights, horizon - from, sums);
            hsep_copy(P, sums, count);
            P += count;
        }
        v[i] = hsep_dot(W + i * horizon + begins[i], target + begins[i], horizon - begins[i]);
    }
}

HSEP_API void hsep_newton_init(
    hsep_newton *self, const hsep_predictor_parameters *parameters, hsep_planner *plans, const hsep_real spline[])
{
    (void)hsep_newton_lay_out(self, parameters);
    self->share = 1.0;
    self->reach = HSEP_NEWTON_FIRST_REACH;
    hsep_linearised_init(hsep_part(self, self->linearised), parameters);
    const hsep_splines *splines = hsep_planner_splines(plans);
    const hsep_int spacing = splines->spacing, horizon = self->horizon, half = horizon / 2;
    const hsep_int full = self->Np > half ? self->Np : half; /* errors that count in full; later ones fall */
    const hsep_real *b = hsep_splines_shape(splines);
    hsep_real *weight = hsep_at(self, self->weight);
    for (hsep_int k = 0; k < horizon; k++) {
        const hsep_real left = (hsep_real)(horizon - k) / (hsep_real)(horizon - full + 1);
        weight[k] = k < full ? 1.0 : hsep_fmax(HSEP_SPLINES_LEAST, left);
    }
    for (hsep_int i = 0; i < self->m; i++) { /* splines of each distance of knots, and W with only the physics model */
        const hsep_knot knot = hsep_knots_at(&plans->knots, i);
        const hsep_int begin = (plans->n_pinned + knot.begin) * spacing;
        hsep_real *shape = newton_level(self, self->shapes, knot.level),
                  *passed = newton_level(self, self->passed, knot.level);
        newton_begins(self)[i] = begin;
        hsep_zero(shape, horizon);
        hsep_zero(passed, horizon);
        for (hsep_int j = 0; j < knot.length; j++) {
            hsep_axpy(shape + j * spacing, knot.share[j], b, 4 * spacing);
            hsep_axpy(passed + j * spacing, knot.share[j], spline, horizon - j * spacing);
        }
        for (hsep_int k = begin; k < horizon; k++) {
            hsep_at(self, self->W)[i * horizon + k] = weight[k] * passed[k - begin];
        }
    }
    newton_products(self, plans);
    hsep_copy(hsep_at(self, self->gram), hsep_planner_quadratic(plans), (hsep_int)hsep_triangle(self->m));
}

/* Half of the change of velocity that the slope of the next Newton step is taken over: a share of what this one changes
 * the best plan, or would, RMS, relative to the model's scale. */
static hsep_real newton_next_reach(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_real scale = task->model->forecast_scale * hsep_averaged_disturbances(task->model)->T_s;
    const hsep_int n = HSEP_N_DECIDED + self->n;
    hsep_real *change = hsep_at(self, self->target), last = 0.0, squares = 0.0;
    newton_copy(self, change, hsep_planner_coefficients(task->planner));
    hsep_axpy(change, -1.0, hsep_at(self, self->best), n);
    for (hsep_int k = 0; k < self->horizon; k++) {
        const hsep_real delta = hsep_splines_sum(hsep_planner_splines(task->planner), change, n, k);
        squares += (delta - last) * (delta - last);
        last = delta;
    }
    const hsep_real speed = scale > 0.0 ? hsep_sqrt(squares / (hsep_real)self->horizon) / scale : 0.0;
    return hsep_fmax(HSEP_NEWTON_LEAST_REACH, HSEP_NEWTON_REACH * speed);
}

/* Judge a length of a step, whose end the planner has; take it if it is better, otherwise a shorter one is tried. */
static void newton_judge(hsep_newton *self, const hsep_newton_task *task)
{
    hsep_real *c = hsep_planner_coefficients(task->planner), *best = hsep_at(self, self->best);
    const hsep_real cost = newton_cost(self, task, c);
    if (newton_better(cost, self->cost)) {
        self->gains = 1;
        self->cost = cost;
        newton_copy(self, best, c);
    } else if (self->tries + 1 < HSEP_NEWTON_TRIES) {
        const hsep_real shorter = newton_lengths[self->tries + 1] / newton_lengths[self->tries];
        for (hsep_int j = HSEP_N_DECIDED; j < HSEP_N_DECIDED + self->n; j++) {
            c[j] = best[j] + shorter * (c[j] - best[j]);
        }
    } else {
        self->reach = self->wider;
    }
}

/* Take a share of what the best plan changes, smaller where it takes back what the last plan has changed, or gains
 * little beside the variance of its prediction. */
static void newton_take(hsep_newton *self, const hsep_planner *planner)
{
    const hsep_int window = self->Np / hsep_planner_splines(planner)->spacing, first = planner->n_pinned;
    const hsep_int count = hsep_min(HSEP_PLANNING_NEAR * window, self->n) - first;
    hsep_real *best = hsep_at(self, self->best) + HSEP_N_DECIDED, *corrected = hsep_at(self, self->corrected);
    const hsep_real *remainder = hsep_at(self, self->remainder) + HSEP_N_DECIDED;
    const hsep_real *before = corrected + first, *now = best + first;
    hsep_axpy(best, -1.0, remainder, self->n); /* the change */
    const hsep_real size = hsep_sqrt(hsep_dot(now, now, count)) * hsep_sqrt(hsep_dot(before, before, count));
    const hsep_real cosine = size > 0.0 ? hsep_dot(now, before, count) / size : 0.0;
    self->share = hsep_fmax(self->share * (1.0 + HSEP_PLANNING_TAKEN_BACK * cosine), HSEP_PLANNING_LEAST_SHARE);
    self->share = hsep_fmin(self->share, 1.0);
    const hsep_real gain = self->cost_of_remainder - self->cost;
    const hsep_real left = gain > 0.0 ? 1.0 / (1.0 + HSEP_PLANNING_DOUBT * self->doubt / gain) : 0.0;
    const hsep_real share = left > 0.0 ? self->share * left : 0.0; /* not NaN */
    for (hsep_int i = 0; i < self->n; i++) {
        corrected[i] = share * best[i];
        best[i] = remainder[i] + corrected[i];
    }
}

/* Take the plan that costs least, of the averaged model's change a share; the physics model's was predicted last. */
static void newton_compare(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_real of_physics = newton_cost(self, task, hsep_at(self, self->of_physics));
    const int is_last = newton_better(self->cost_of_remainder, of_physics);
    hsep_int plan = is_last ? self->remainder : self->of_physics;
    self->planned = !is_last;
    if (self->may_plan && newton_better(self->cost, of_physics)) {
        newton_take(self, task->planner);
        plan = self->best;
        self->planned = 2;
    } else {
        hsep_zero(hsep_at(self, self->corrected), self->n);
    }
    newton_copy(self, hsep_planner_coefficients(task->planner), hsep_at(self, plan));
}

/* What parts of a plan count as: columns abreast by an expert; some variances, or those after the window, which take
 * more samples; what passes through the model or the solver once, for all samples of a plan; and half a prediction of a
 * plan, the slopes under it, or the jerk of a programme. */
#define NEWTON_COLUMNS 3
#define NEWTON_SOME 4
#define NEWTON_BEHIND 6
#define NEWTON_PASS 8
#define NEWTON_PREDICTION 14

/* Parts into which a count is cut, each of at most so many. */
static hsep_int newton_parts(hsep_int count, hsep_int most) { return (count + most - 1) / most; }

/* What the products of a programme count as, or its factor, */
static hsep_int newton_of_programme(const hsep_newton *self) { return self->m / 4; }

/* its solution in so many halves of steps, which are a factor, then a pass, */
static hsep_int newton_of_solution(const hsep_newton *self, hsep_int halves)
{
    return halves / 2 * NEWTON_PASS + (halves + 1) / 2 * newton_of_programme(self);
}

/* and columns abreast from one on. */
static hsep_int newton_of_columns(hsep_newton *self, const hsep_newton_task *task, hsep_int first)
{
    const hsep_int full = NEWTON_COLUMNS * hsep_linearised_experts(task->model);
    const int begins = first == hsep_knots_at(&task->planner->knots, first).first;
    return newton_parts(full * (self->horizon - newton_begins(self)[first]), self->horizon) +
           (begins ? NEWTON_SOME : 0);
}

/* What all yields of newton_go_on count as in the longest plan, samples of whose window are predicted already. A second
 * length of a Newton step, rarely tried, adds a prediction where it is, and so does what begins after it. */
static hsep_int newton_of_plan(hsep_newton *self, const hsep_newton_task *task, hsep_int predicted)
{
    const hsep_int window = self->late + self->Np, beyond = self->horizon - self->Np;
    const hsep_int of_physics = NEWTON_PREDICTION + newton_of_solution(self, 2 * HSEP_NEWTON_PHYSICS_STEPS + 1);
    hsep_int step = NEWTON_SOME + 4 * NEWTON_PREDICTION + newton_of_programme(self) +
                    newton_of_solution(self, 2 * task->planner->steps + 1);
    for (hsep_int i = 0; i < self->m; i += newton_together(task->planner, i)) {
        step += newton_of_columns(self, task, i);
    }
    return NEWTON_SOME * newton_parts(window - predicted, HSEP_NEWTON_VARIED) +
           NEWTON_BEHIND * newton_parts(beyond, HSEP_NEWTON_VARIANCE_STRIDE * HSEP_NEWTON_VARIED) + of_physics +
           self->n_steps * step + 2 * NEWTON_PREDICTION + NEWTON_PASS +
           NEWTON_SOME * newton_parts(window, HSEP_NEWTON_VARIED);
}

/* Predict more samples under a plan, up to one; the first ones with its commands. stride: as hsep_averaged_go_on's. */
static void newton_predict(
    hsep_newton *self, const hsep_newton_task *task, const hsep_real c[], hsep_int last, hsep_int stride)
{
    hsep_real *x_pb = hsep_at(self, self->x_pb), *e_h = hsep_at(self, self->e_h);
    if (self->samples == 0) {
        newton_command(self, task, c, HSEP_N_DECIDED + self->n);
        hsep_averaged_predict(task->model, hsep_at(self, self->command), x_pb, e_h, last, stride);
    } else {
        hsep_averaged_go_on(task->model, x_pb, e_h, self->samples, last, stride);
    }
    self->samples = last;
}

/* Predict the next ones with variances, one for each sample in the window, and one for some after it. */
static void newton_vary(hsep_newton *self, const hsep_newton_task *task, const hsep_real c[])
{
    const hsep_int window = self->late + self->Np, stride = self->samples < window ? 1 : HSEP_NEWTON_VARIANCE_STRIDE;
    const hsep_int end = stride == 1 ? window : self->late + self->horizon;
    newton_predict(self, task, c, hsep_min(self->samples + stride * HSEP_NEWTON_VARIED, end), stride);
}

/* Cut a plan: what follows counts as so much, and is done when newton_go_on is called again; where: another one for
 * each. A switch into the midst of a function goes on there (protothreads, Dunkels et al. 2006). */
#define NEWTON_MADE 99 /* place after the last yield */
#define NEWTON_YIELD(where, count) \
    do { \
        self->place = (where); \
        self->next = (count); \
        return; \
    case (where):; \
    } while (0)

/* Predict a plan without variances. */
#define NEWTON_PREDICT(where, then, c) \
    self->samples = 0; \
    NEWTON_YIELD(where, NEWTON_PREDICTION); \
    newton_predict(self, task, c, all / 8, 0); \
    NEWTON_YIELD(then, NEWTON_PREDICTION); \
    newton_predict(self, task, c, all, 0)

/* Predict more samples of the plan with variances, up to one. */
#define NEWTON_VARY(where, end) \
    while (self->samples < (end)) { \
        NEWTON_YIELD( \
            where, self->samples > self->late + self->Np ? NEWTON_BEHIND \
                                                         : NEWTON_SOME + (self->samples > 0 ? 0 : NEWTON_PASS)); \
        newton_vary(self, task, c); \
    }

/* Solve a programme in a number of steps of its solver; those that it does not need are left out. */
#define NEWTON_SOLVE(where, then, steps) \
    NEWTON_YIELD(where, newton_of_programme(self)); \
    self->status = hsep_planner_solve(planner, steps); \
    for (self->halves = 2 * (steps); self->status == HSEP_PLAN_BOUNDED; self->halves--) { \
        NEWTON_YIELD(then, self->halves % 2 ? NEWTON_PASS : newton_of_programme(self)); \
        self->status = hsep_planner_advance(planner); \
    } \
    self->left -= hsep_min(newton_of_solution(self, self->halves), self->left)

/* Make a plan, from one yield to the next; what all of them count as is in newton_of_plan. */
static void newton_go_on(hsep_newton *self, const hsep_newton_task *task)
{
    const hsep_int all = self->late + self->horizon;
    const hsep_int straight = self->n_steps > 2 ? self->horizon / HSEP_PLANNING_STRAIGHT : 0;
    hsep_planner *planner = task->planner;
    hsep_real *c = hsep_planner_coefficients(planner), *remainder = hsep_at(self, self->remainder);
    hsep_real *of_physics = hsep_at(self, self->of_physics), *corrected = hsep_at(self, self->corrected);
    const hsep_int kept = self->Np / hsep_planner_splines(planner)->spacing;

    switch (self->place) {
    case 0:
        /* The remainder of the last plan, with the variances of all plans, which have a stack of their own */
        hsep_averaged_weigh(task->model, HSEP_OF_PLANS, hsep_at(self, self->e_h), self->samples);
        if (self->judges) {
            NEWTON_VARY(1, all)
            self->cost = newton_cost(self, task, remainder);
            self->doubt = newton_doubt(self, task);
        }
        hsep_averaged_keep_ahead(task->model, self->judges > 0);

        /* The physics model's plan; without one the remainder of the last plan goes on */
        if (self->planned) {
            NEWTON_YIELD(2, NEWTON_PREDICTION);
            newton_open(self, task);
            NEWTON_SOLVE(3, 4, self->may_plan ? HSEP_NEWTON_PHYSICS_STEPS : planner->steps);
            self->planned = self->status == HSEP_PLAN_DONE;
        }
        newton_copy(self, of_physics, c);
        self->judges = self->judges && self->planned;
        self->may_plan = self->may_plan && self->planned;
        /* What the last plan changed, as far as it is in its remainder, which this plan may change */
        hsep_copy(corrected, corrected + kept, self->n - kept);
        hsep_zero(self->may_plan ? corrected + (self->n - kept) : corrected, self->may_plan ? kept : self->n);

        /* In place of the remainder of the last plan one that ends compensation, where it is off */
        self->cost_of_remainder = self->cost;
        if (self->ends) {
            newton_copy(self, c, remainder);
            NEWTON_YIELD(5, NEWTON_PREDICTION);
            hsep_planner_end(planner, task->x_d);
            NEWTON_SOLVE(6, 7, planner->steps);
        }

        /* Newton steps, the first from the remainder of the last plan, each from the best plan so far */
        newton_copy(self, hsep_at(self, self->best), remainder);
        self->gains = 1;
        for (self->steps = 0; self->may_plan && self->steps < self->n_steps; self->steps++) {
            if (!self->gains) { /* what was predicted last was no better */
                self->left += 2 * NEWTON_PREDICTION;
                NEWTON_PREDICT(8, 9, hsep_at(self, self->best));
            }
            NEWTON_YIELD(10, NEWTON_SOME);
            newton_copy(self, c, hsep_at(self, self->best));
            hsep_planner_open(planner, task->x_d, self->horizon - straight, self->bound); /* it follows the friction */
            NEWTON_YIELD(11, NEWTON_PREDICTION);
            (void)newton_errors(self, task);
            hsep_linearised_at(
                hsep_part(self, self->linearised), task->model, hsep_at(self, self->command), hsep_at(self, self->x_pb),
                self->reach);
            for (self->spline = 0; self->spline < self->m;) {
                NEWTON_YIELD(12, newton_of_columns(self, task, self->spline));
                newton_columns(self, task);
            }
            NEWTON_YIELD(13, newton_of_programme(self) + NEWTON_PREDICTION);
            newton_products(self, planner);
            hsep_planner_complete(planner, planner->jerk_weight);
            NEWTON_SOLVE(14, 15, planner->steps);
            self->gains = 0;
            if (self->status != HSEP_PLAN_FAILED) {
                self->wider = hsep_fmin(HSEP_NEWTON_WIDER * self->reach, HSEP_NEWTON_MOST_REACH);
                self->reach = newton_next_reach(self, task);
                self->wider = hsep_fmax(self->reach, self->wider);
            }
            self->tries = self->status != HSEP_PLAN_FAILED ? 0 : HSEP_NEWTON_TRIES;
            for (; !self->gains && self->tries < HSEP_NEWTON_TRIES; self->tries++) {
                self->left += self->tries > 0 ? 2 * NEWTON_PREDICTION : 0;
                NEWTON_PREDICT(16, 17, c);
                newton_judge(self, task);
            }
        }

        /* The best of them and the physics model's plan */
        if (self->judges) {
            NEWTON_PREDICT(18, 19, of_physics);
            newton_compare(self, task);
        }

        /* What of it may be carried out */
        hsep_planner_carry_out(planner, task->x_d);

        /* The window under the plan, and its variances */
        self->samples = 0;
        hsep_averaged_weigh(task->model, HSEP_OF_PREDICTIONS, hsep_at(self, self->e_h), 0);
        NEWTON_VARY(20, self->late + self->Np)
    }
    self->place = NEWTON_MADE;
}

HSEP_API void hsep_newton_run(hsep_newton *self, const hsep_newton_task *task, hsep_int samples)
{
    const hsep_int share = samples > 1 ? newton_parts(self->left, samples) : 0;
    hsep_int done = 0;
    while (self->place != NEWTON_MADE && (samples <= 1 || done == 0 || done + self->next / 2 <= share)) {
        done += self->next;
        newton_go_on(self, task);
    }
    self->left -= hsep_min(done, self->left);
}

HSEP_API void hsep_newton_begin(hsep_newton *self, const hsep_newton_task *task, hsep_int allowed, hsep_int before)
{
    const hsep_predictor *predictor = task->predictor;
    const hsep_real *residuals = hsep_at_const(predictor, predictor->past_e) + predictor->n; /* last ones measured */
    hsep_real *path = hsep_at(self, self->target), *remainder = hsep_at(self, self->remainder);
    self->place = 0;
    newton_copy(self, remainder, hsep_planner_coefficients(task->planner));
    hsep_copy(hsep_at(self, self->physics), hsep_at_const(predictor, predictor->physics), self->trial - self->physics);
    hsep_copy(
        hsep_at(self, self->command) + self->horizon, hsep_at_const(predictor, predictor->command) + self->Np,
        self->late);
    hsep_copy(
        hsep_at(self, self->x_pb) + self->horizon, hsep_at_const(predictor, predictor->past_x) + self->Np, self->late);
    hsep_copy(hsep_at(self, self->e_h) + self->horizon + self->late, residuals, predictor->p);
    for (hsep_int k = 0; k < self->horizon; k++) {
        path[self->horizon - 1 - k] = task->x_d[k] - task->predictor->start;
    }
    self->bound = newton_outgrows(self, task) ? HSEP_PLANNING_UNPROVEN : 1.0;
    newton_command(self, task, remainder, HSEP_N_DECIDED + self->n);
    const hsep_int pinned = hsep_planner_pinned(task->planner); /* they are published now */
    self->samples = self->late + (pinned > 0 ? pinned : 1);
    hsep_averaged_forecast(
        task->model, hsep_at(self, self->command), hsep_at(self, self->x_pb), path, self->horizon,
        hsep_at(self, self->e_h), self->samples);
    self->ends = allowed == 0 && before > 0;
    self->planned = allowed > 0;
    self->is_physics = allowed == 1;
    self->judges = self->planned && (hsep_real)predictor->k >= predictor->n_init && task->model->predicted[HSEP_STATIC];
    self->may_plan = self->judges && allowed > 1;
    /* This sample has begun, and learned the last window */
    self->next = 4 * NEWTON_PASS + NEWTON_SOME * newton_parts(self->samples, HSEP_NEWTON_VARIED);
    self->left = self->next + newton_of_plan(self, task, self->samples);
}

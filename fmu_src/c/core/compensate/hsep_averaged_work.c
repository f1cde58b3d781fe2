/* Work of the parts of a plan on the residual model with averaging, in multiply-adds, counted from the sizes and
 * not timed, so that samples can share it equally on any processor. */
#include "hsep_averaged_planner.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"

/* Multiply-adds that these count for, on the whole: python -m benchmarks.instructions counts what they stand for. Of
 * a prediction: a tanh; a sample's command besides; its part of the cost; its part of an expert; its lags without a
 * row of its own. Of a linearisation: a sample's slopes besides one tanh; what it has in common with others; the
 * rest; of a column a sample, its beginning and a lag. Of the programmes: what completes one, a sample; pivots of
 * its factor; a product of columns, to begin; commands and bounds of a plan, a sample; of the physics model's, a
 * pair of splines; the bounds of a sample, and whether they allow the free minimum. Of a solver step, which has 4
 * rows and 2 sides a sample: residuals, directions, and their matrix, for a spline. */
static const hsep_real work_tanh = 40.0, work_command = 135.0, work_cost = 185.0, work_of_expert = 60.0,
                       work_held = 600.0;
static const hsep_real work_slope = 205.0, work_change = 50.0, work_sample = 155.0, work_column = 8.0,
                       work_group = 400.0, work_lag = 0.85;
static const hsep_real work_completed = 50.0, work_pivots = 1.5, work_product = 9.0, work_target = 130.0,
                       work_shifted = 20.0, work_bounds = 280.0, work_allowed = 90.0;
static const hsep_real work_residuals = 160.0, work_slacks = 400.0, work_gram = 200.0;

static const hsep_int work_solved[1 + HSEP_AVERAGED_STEPS] = {HSEP_NEWTON_SOLVED};

/* Disturbances that are filtered for a prediction: of the command once, stiffness and damping twice. Of a stop
 * operator, in a sample of a prediction, and of a column, most of which it leaves early. */
static const hsep_real work_filtered = HSEP_DISTURBANCES_OF_COMMAND + 4.0, work_of_mode = 9.0, work_stop = 12.0,
                       work_stopped = 1.5;

/* Of the experts that predict: their number, features, squares of these, and lags. */
typedef struct {
    hsep_real count, features, squares, lags;
} work_experts;

/* The sizes as they are used. */
typedef struct {
    hsep_real all, preview, spacing; /* samples */
    hsep_real free;                  /* splines that are not pinned */
    hsep_real modes;
    work_experts experts;
    hsep_int n_columns;                /* experts that columns take work for, */
    hsep_real columns[HSEP_N_EXPERTS]; /* and their lags */
} work_sizes;

static work_experts work_of_experts(hsep_averaged *model)
{
    work_experts sum = {0.0, 0.0, 0.0, 0.0};
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        if (model->predicted[i]) {
            const hsep_expert *expert = hsep_averaged_expert(model, i);
            const hsep_real n = (hsep_real)(expert->p + expert->n_static);
            sum.count += 1.0;
            sum.features += n;
            sum.squares += n * n;
            sum.lags += (hsep_real)expert->p;
        }
    }
    return sum;
}

static work_sizes work_of(const hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const hsep_physics *physics = (const hsep_physics *)hsep_at_const(self, self->physics);
    work_sizes sizes = {
        .all = (hsep_real)(self->preview + self->late),
        .preview = (hsep_real)self->preview,
        .spacing = (hsep_real)hsep_planner_splines(task->planner)->spacing,
        .free = (hsep_real)(self->n - self->n_pinned),
        .modes = (hsep_real)physics->n_modes,
        .experts = work_of_experts(task->model)};
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        if (hsep_linearised_counts(task->model, i)) {
            sizes.columns[sizes.n_columns++] = (hsep_real)hsep_averaged_expert(task->model, i)->p;
        }
    }
    return sizes;
}

/* A factor of the free splines, and solutions with it. */
static hsep_real work_factor(const work_sizes *sizes, hsep_real solutions)
{
    return sizes->free * sizes->free * (sizes->free / 6.0 + solutions);
}

/* Parts of an interior-point step, and all of it. */
static hsep_real work_interior_part(const work_sizes *sizes, hsep_int part)
{
    const hsep_real n = sizes->free;
    if (part == 0) {
        return n * n + work_residuals * sizes->preview;
    }
    if (part < HSEP_INTERIOR_PARTS - 1) {
        return 0.5 * (work_factor(sizes, 0.0) + work_gram * sizes->spacing * n);
    }
    return 2.0 * n * n + work_slacks * sizes->preview;
}

static hsep_real work_interior(const work_sizes *sizes)
{
    hsep_real sum = 0.0;
    for (hsep_int part = 0; part < HSEP_INTERIOR_PARTS; part++) {
        sum += work_interior_part(sizes, part);
    }
    return sum;
}

/* A programme up to its first step, of all the part after its factor, and of that the part of one that follows a
 * bounded one. */
static hsep_real work_bound(const work_sizes *sizes) { return work_bounds * sizes->preview; }

static hsep_real work_factored(const work_sizes *sizes)
{
    return work_bound(sizes) + work_allowed * sizes->preview + 2.0 * sizes->free * sizes->free;
}

static hsep_real work_solve(const work_sizes *sizes) { return work_factor(sizes, work_pivots) + work_factored(sizes); }

/* Commands and bounds of a plan, and the physics model's programme. */
static hsep_real work_open(const work_sizes *sizes) { return work_target * sizes->preview; }
static hsep_real work_aim(const work_sizes *sizes) { return work_shifted * sizes->free * sizes->free; }

/* Commands of a plan with their disturbances, and count samples that the experts predict. */
static hsep_real work_commands(const work_sizes *sizes)
{
    return sizes->all * (HSEP_FEATURES_N_FRICTION * work_tanh + HSEP_FEATURES_N_STOPS * work_stop +
                         work_filtered * work_of_mode * sizes->modes + work_command);
}

static hsep_real work_run(const work_sizes *sizes, hsep_real count)
{
    return count * (sizes->experts.features + work_of_expert * sizes->experts.count);
}

/* A prediction and its cost. */
static hsep_real work_predict(const work_sizes *sizes)
{
    return work_commands(sizes) + work_run(sizes, sizes->all) + work_cost * sizes->preview;
}

/* The part of a prediction that comes next. */
static hsep_real work_next(const hsep_averaged_planner *self, const work_sizes *sizes)
{
    const hsep_real first = work_commands(sizes) + work_run(sizes, sizes->all / HSEP_AVERAGED_AT_FIRST);
    return self->predicted > 0 ? work_predict(sizes) - first : first;
}

/* Count samples and their variances: leverages of rows, one for every apart, carried through the recursion. */
static hsep_real work_samples(const work_sizes *sizes, hsep_real count, hsep_real apart)
{
    const hsep_real leverages = (0.6 * sizes->experts.squares + 6.0 * sizes->experts.features) / apart;
    return work_run(sizes, count) + count * (leverages + 2.0 * sizes->all + (apart > 1.0 ? work_held : 0.0));
}

static hsep_real work_slopes(const work_sizes *sizes)
{
    return sizes->all * (HSEP_FEATURES_N_FRICTION * work_tanh + HSEP_FEATURES_N_STOPS * work_stop + work_slope);
}

static hsep_real work_linearise(const work_sizes *sizes) { return sizes->all * work_sample; }

static hsep_real work_begin(const work_sizes *sizes) { return sizes->all * (sizes->experts.lags + work_change); }

/* A part of the columns that begin with spline j, side by side. */
static hsep_real work_columns(const work_sizes *sizes, hsep_real j, hsep_int part)
{
    const hsep_real length = sizes->preview - sizes->spacing * j;
    hsep_real sum = work_group + (part == 0 ? length : 0.0);
    if (part < sizes->n_columns) {
        const hsep_real p = sizes->columns[part];
        const hsep_real lags = length > p ? p * (length - 0.5 * p) : 0.5 * length * length;
        sum += work_lag * lags +
               length * (work_of_mode * sizes->modes + work_column + HSEP_FEATURES_N_STOPS * work_stopped);
    }
    return HSEP_PHYSICS_ABREAST * sum;
}

/* Those from spline j on, but the first parts of the next ones. */
static hsep_real work_columns_left(
    const hsep_averaged_planner *self, const work_sizes *sizes, hsep_int j, hsep_int first)
{
    hsep_real sum = 0.0;
    for (; j < self->n; j += HSEP_PHYSICS_ABREAST, first = 0) {
        for (hsep_int part = first; part == 0 || part < sizes->n_columns; part++) {
            sum += work_columns(sizes, (hsep_real)j, part);
        }
    }
    return sum;
}

/* Products of the last n columns with each other. */
static hsep_real work_products(const hsep_averaged_planner *self, const work_sizes *sizes, hsep_int row)
{
    const hsep_real n = row < self->n ? (hsep_real)(self->n - row) : 0.0,
                    longest = sizes->preview - sizes->spacing * (hsep_real)row;
    return n * (n + 1.0) * (0.5 * longest - sizes->spacing * (n - 1.0) / 3.0 + work_product);
}

HSEP_API hsep_real hsep_averaged_planner_next(const hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const work_sizes sizes = work_of(self, task);
    switch ((hsep_averaged_stage)self->stage) {
    case HSEP_AVERAGED_DONE:
        return 0.0;
    case HSEP_AVERAGED_VARY:
        return self->varied < self->late + self->Np
                   ? work_samples(&sizes, HSEP_AVERAGED_VARIED, 1.0)
                   : work_samples(&sizes, HSEP_NEWTON_APART * HSEP_AVERAGED_VARIED, HSEP_NEWTON_APART);
    case HSEP_AVERAGED_CHANGE:
        return work_begin(&sizes);
    case HSEP_AVERAGED_BEGIN:
        return work_open(&sizes);
    case HSEP_AVERAGED_AIM:
        return work_aim(&sizes);
    case HSEP_AVERAGED_AIMED:
        return work_factor(&sizes, work_pivots);
    case HSEP_AVERAGED_FACTOR:
        return self->bounded ? work_completed * sizes.preview : work_factor(&sizes, work_pivots);
    case HSEP_AVERAGED_FACTORED:
        return work_factored(&sizes);
    case HSEP_AVERAGED_SOLVE:
        return self->bounded ? work_bound(&sizes) : work_factored(&sizes);
    case HSEP_AVERAGED_PHYSICS:
    case HSEP_AVERAGED_BOUNDED:
        return work_interior_part(&sizes, hsep_planner_part(task->planner));
    case HSEP_AVERAGED_STEP:
        return (self->steps == 0 ? work_open(&sizes) : 0.0) + work_slopes(&sizes);
    case HSEP_AVERAGED_AT:
        return work_linearise(&sizes);
    case HSEP_AVERAGED_COLUMN:
        return work_columns(&sizes, (hsep_real)self->columns, self->part);
    case HSEP_AVERAGED_PRODUCT:
        return work_products(self, &sizes, self->rows) -
               work_products(self, &sizes, self->rows + HSEP_AVERAGED_PRODUCTS);
    case HSEP_AVERAGED_JUDGE:
    case HSEP_AVERAGED_COMPARE:
        return work_next(self, &sizes);
    case HSEP_AVERAGED_PREDICT:
        break;
    }
    return (self->predicted > 0 ? 0.0 : work_commands(&sizes)) + work_samples(&sizes, HSEP_AVERAGED_VARIED, 1.0);
}

/* Solver steps of a programme at most, after those that are done. */
static hsep_real work_steps(const work_sizes *sizes, hsep_int programme, hsep_int done)
{
    const hsep_int most = work_solved[programme];
    return done < most ? (hsep_real)(most - done) * work_interior(sizes) : 0.0;
}

/* Lengths of a Newton step. */
static hsep_real work_judge(const hsep_averaged_planner *self, const work_sizes *sizes)
{
    return (hsep_real)(HSEP_AVERAGED_TRIES - self->tries) * work_predict(sizes);
}

/* From the solution of a Newton step's programme on, up to the next step. */
static hsep_real work_programme(const hsep_averaged_planner *self, const work_sizes *sizes, hsep_int step)
{
    const hsep_real begin = self->bounded || step > self->steps + 1 ? work_bound(sizes) : work_solve(sizes);
    return begin + work_steps(sizes, step, 0) + HSEP_AVERAGED_TRIES * work_predict(sizes);
}

/* Newton steps that have not begun. */
static hsep_real work_newton(const hsep_averaged_planner *self, const work_sizes *sizes)
{
    const hsep_real linearise = work_slopes(sizes) + work_linearise(sizes) +
                                work_columns_left(self, sizes, self->n_pinned, 0) +
                                work_products(self, sizes, self->n_pinned);
    hsep_real sum = self->steps == 0 ? work_open(sizes) : 0.0;
    for (hsep_int step = self->steps + 1; step <= HSEP_AVERAGED_STEPS; step++) {
        sum += linearise + work_programme(self, sizes, step);
    }
    return sum;
}

HSEP_API hsep_real hsep_averaged_planner_left(const hsep_averaged_planner *self, const hsep_averaged_task *task)
{
    const work_sizes sizes = work_of(self, task);
    const hsep_real predict = work_predict(&sizes), window = (hsep_real)(self->late + self->Np);
    const hsep_real last = work_commands(&sizes) + work_samples(&sizes, window, 1.0);
    const hsep_real begun = self->predicted > 0 ? predict - work_next(self, &sizes) : 0.0; /* is done */
    const hsep_real after_step = work_newton(self, &sizes) + predict + last;
    const hsep_real after_physics = self->follows ? after_step : self->judges ? predict + last : last;
    const hsep_int programme = self->stage == HSEP_AVERAGED_BOUNDED ? self->steps : 0;
    hsep_real bounded = work_steps(&sizes, programme, hsep_planner_steps(task->planner));
    for (hsep_int part = hsep_planner_part(task->planner); part > 0 && part < HSEP_INTERIOR_PARTS; part++) {
        bounded += work_interior_part(&sizes, part);
    }
    const hsep_real varied = (hsep_real)self->varied, within = varied < window ? window - varied : 0.0;
    const hsep_real behind = sizes.all - hsep_fmax(varied, window);
    const hsep_real solve = work_solve(&sizes) + work_steps(&sizes, 0, 0) + after_physics;
    const hsep_real begin = work_open(&sizes) + work_aim(&sizes) + solve;
    hsep_real left = 0.0;
    switch ((hsep_averaged_stage)self->stage) {
    case HSEP_AVERAGED_DONE:
        return 0.0;
    case HSEP_AVERAGED_VARY:
        left = work_samples(&sizes, within, 1.0) + work_samples(&sizes, behind, HSEP_NEWTON_APART);
        return left + (self->follows ? work_begin(&sizes) : 0.0) + begin;
    case HSEP_AVERAGED_CHANGE:
        return work_begin(&sizes) + begin;
    case HSEP_AVERAGED_BEGIN:
        return begin;
    case HSEP_AVERAGED_AIM:
        return work_aim(&sizes) + solve;
    case HSEP_AVERAGED_AIMED:
        return solve;
    case HSEP_AVERAGED_FACTORED:
        return solve - work_factor(&sizes, work_pivots);
    case HSEP_AVERAGED_PHYSICS:
        return bounded + after_physics;
    case HSEP_AVERAGED_AT:
        left = work_linearise(&sizes) + work_columns_left(self, &sizes, self->n_pinned, 0) +
               work_products(self, &sizes, self->n_pinned) + work_programme(self, &sizes, self->steps);
        break;
    case HSEP_AVERAGED_COLUMN:
        left = work_columns_left(self, &sizes, self->columns, self->part) + work_products(self, &sizes, self->rows) +
               work_programme(self, &sizes, self->steps);
        break;
    case HSEP_AVERAGED_PRODUCT:
        left = work_products(self, &sizes, self->rows) + work_programme(self, &sizes, self->steps);
        break;
    case HSEP_AVERAGED_FACTOR:
        left = work_programme(self, &sizes, self->steps);
        break;
    case HSEP_AVERAGED_SOLVE:
        left = work_programme(self, &sizes, self->steps) - (self->bounded ? 0.0 : work_factor(&sizes, work_pivots));
        break;
    case HSEP_AVERAGED_BOUNDED:
        left = bounded + work_judge(self, &sizes);
        break;
    case HSEP_AVERAGED_JUDGE:
        left = work_judge(self, &sizes) - begun;
        break;
    case HSEP_AVERAGED_COMPARE:
        return predict - begun + last;
    case HSEP_AVERAGED_PREDICT:
        left = self->predicted > 0 ? 0.0 : work_commands(&sizes);
        return left + work_samples(&sizes, window - (hsep_real)self->predicted, 1.0);
    case HSEP_AVERAGED_STEP:
        break;
    }
    return left + after_step;
}

/* Work of the parts of a plan on the residual model with trust, in multiply-adds, counted from the sizes and
 * not timed, so that samples can share it equally on any processor. */
#include "hsep_trusted_planner.h"

#include "hsep_cholesky.h"

/* Multiply-adds that these count for: a tanh; the two halves of an interior-point step besides their matrices, for a
 * sample of a plan with its rows of 4 orders and 2 sides; the beginning of such a step; a linearisation besides
 * recursions and tanh, for a sample; a prediction, for a sample of an expert. */
static const hsep_real work_tanh = 40.0, work_residuals = 200.0, work_slacks = 400.0, work_bounds = 550.0,
                       work_sample = 550.0, work_of_expert = 270.0;

/* Disturbances that are filtered for a prediction: friction once, stiffness and damping twice. */
static const hsep_real work_filtered = 10.0, work_of_mode = 9.0;

/* The sizes as they are used. */
typedef struct {
    hsep_real all, preview, spacing; /* samples */
    hsep_real free;                  /* splines that are not pinned */
    hsep_real modes;
} work_sizes;

static work_sizes work_of(const hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const hsep_physics *physics = (const hsep_physics *)hsep_at_const(self, self->physics);
    return (work_sizes){
        .all = (hsep_real)(self->preview + self->late),
        .preview = (hsep_real)self->preview,
        .spacing = (hsep_real)hsep_planner_splines(task->planner)->spacing,
        .free = (hsep_real)(self->n - self->n_pinned),
        .modes = (hsep_real)physics->n_modes};
}

/* A factor of the free splines, and solutions with it. */
static hsep_real work_factor(const work_sizes *sizes, hsep_real solutions)
{
    return sizes->free * sizes->free * (sizes->free / 6.0 + solutions);
}

/* An interior-point step: its factor, and what follows from it. */
static hsep_real work_factored(const work_sizes *sizes)
{
    return work_factor(sizes, 0.0) + 40.0 * sizes->spacing * sizes->free + work_residuals * sizes->preview;
}

static hsep_real work_directions(const work_sizes *sizes)
{
    return 2.0 * sizes->free * sizes->free + work_slacks * sizes->preview;
}

static hsep_real work_interior(const work_sizes *sizes) { return work_factored(sizes) + work_directions(sizes); }

static hsep_real work_begin(const work_sizes *sizes)
{
    return work_factor(sizes, 1.0) + sizes->free * sizes->preview + work_bounds * sizes->preview;
}

static hsep_real work_try(const work_sizes *sizes) { return work_factor(sizes, 2.0) + work_bounds * sizes->preview; }

/* Of the experts that predict: their number, features, squares of these, and lags. */
typedef struct {
    hsep_real count, features, squares, lags;
} work_experts;

static work_experts work_of_experts(hsep_trusted *model)
{
    work_experts sum = {0.0, 0.0, 0.0, 0.0};
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (model->predicted[i]) {
            const hsep_expert *expert = hsep_trusted_expert(model, i);
            const hsep_real n = (hsep_real)(expert->p + expert->n_static);
            sum.count += 1.0;
            sum.features += n;
            sum.squares += n * n;
            sum.lags += (hsep_real)expert->p;
        }
    }
    return sum;
}

static hsep_real work_predict(const work_sizes *sizes, hsep_trusted *model)
{
    const work_experts experts = work_of_experts(model);
    return sizes->all * (experts.features + work_of_expert * experts.count + HSEP_DISTURBANCES_N_FRICTION * work_tanh +
                         work_filtered * work_of_mode * sizes->modes);
}

/* Variances of count samples: leverages of rows, carried through the recursion. */
static hsep_real work_vary(const work_sizes *sizes, hsep_trusted *model, hsep_real count)
{
    const work_experts experts = work_of_experts(model);
    return count * (0.55 * experts.squares + 2.0 * experts.features + 2.0 * sizes->all);
}

static hsep_real work_step(const work_sizes *sizes, hsep_trusted *model)
{
    return sizes->all * (2.0 * HSEP_DISTURBANCES_N_FRICTION * work_tanh + work_of_experts(model).lags + work_sample);
}

/* Columns that begin with spline j, side by side. */
static hsep_real work_columns(const work_sizes *sizes, hsep_trusted *model, hsep_real j)
{
    const hsep_real length = sizes->preview - sizes->spacing * j;
    hsep_real sum = 0.0;
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (model->predicted[i] && hsep_trusted_kind_of(model, i) == HSEP_OF_PHYSICS) {
            const hsep_real p = (hsep_real)hsep_trusted_expert(model, i)->p;
            const hsep_real lags = length > p ? p * (length - 0.5 * p) : 0.5 * length * length;
            sum += HSEP_PHYSICS_ABREAST * (lags + length * (work_of_mode * sizes->modes + 10.0));
        }
    }
    return sum + HSEP_PHYSICS_ABREAST * length;
}

static hsep_real work_columns_left(
    const hsep_trusted_planner *self, const work_sizes *sizes, hsep_trusted *model, hsep_word j)
{
    hsep_real sum = 0.0;
    for (; j < self->n; j += HSEP_PHYSICS_ABREAST) {
        sum += work_columns(sizes, model, (hsep_real)j);
    }
    return sum;
}

static hsep_real work_products(const hsep_trusted_planner *self, const work_sizes *sizes)
{
    const hsep_real n = sizes->free, longest = sizes->preview - sizes->spacing * (hsep_real)self->n_pinned;
    return n * (n + 1.0) * (0.5 * longest - sizes->spacing * (n - 1.0) / 3.0);
}

HSEP_API hsep_real hsep_trusted_planner_next(const hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const work_sizes sizes = work_of(self, task);
    hsep_trusted *model = task->model;
    switch ((hsep_trusted_stage)self->stage) {
    case HSEP_TRUSTED_DONE:
        return 0.0;
    case HSEP_TRUSTED_VARY:
        return work_vary(&sizes, model, HSEP_TRUSTED_VARIED);
    case HSEP_TRUSTED_BEGIN:
        return work_begin(&sizes);
    case HSEP_TRUSTED_PHYSICS:
    case HSEP_TRUSTED_BOUNDED:
        return hsep_planner_within_step(task->planner) ? work_directions(&sizes) : work_factored(&sizes);
    case HSEP_TRUSTED_STEP:
        return work_step(&sizes, model);
    case HSEP_TRUSTED_COLUMN:
        return work_columns(&sizes, model, (hsep_real)self->columns);
    case HSEP_TRUSTED_PRODUCT:
        return work_products(self, &sizes);
    case HSEP_TRUSTED_TRY:
        return work_try(&sizes);
    case HSEP_TRUSTED_REST:
    case HSEP_TRUSTED_JUDGE:
    case HSEP_TRUSTED_COMPARE:
        return work_predict(&sizes, model);
    case HSEP_TRUSTED_PREDICT:
        break;
    }
    return work_predict(&sizes, model) + work_vary(&sizes, model, (hsep_real)(self->late + self->Np));
}

/* Newton steps and tries from here on, of which a programme's solver has done some steps. */
static hsep_real work_newton_left(
    const hsep_trusted_planner *self, const work_sizes *sizes, hsep_trusted *model, hsep_word solved)
{
    const hsep_word most = HSEP_TRUSTED_SOLVER - 1 + HSEP_TRUSTED_SOLVED, done = self->solver_steps + solved;
    const hsep_real solver = done < most ? (hsep_real)(most - done) : 0.0;
    const hsep_real steps = (hsep_real)(HSEP_TRUSTED_STEPS - self->steps);
    const hsep_real tries = (hsep_real)(HSEP_TRUSTED_TOGETHER - self->tries_in_all);
    return steps * (work_step(sizes, model) + work_columns_left(self, sizes, model, self->n_pinned) +
                    work_products(self, sizes)) +
           tries * (work_try(sizes) + work_predict(sizes, model)) + solver * work_interior(sizes);
}

HSEP_API hsep_real hsep_trusted_planner_left(const hsep_trusted_planner *self, const hsep_trusted_task *task)
{
    const work_sizes sizes = work_of(self, task);
    hsep_trusted *model = task->model;
    const int follows = self->follows != 0;
    const hsep_word solved = hsep_planner_steps(task->planner);
    const hsep_real rest = hsep_planner_within_step(task->planner) ? work_directions(&sizes) : 0.0;
    const hsep_real predict = work_predict(&sizes, model), newton = work_newton_left(self, &sizes, model, 0);
    const hsep_real last = predict + work_vary(&sizes, model, (hsep_real)(self->late + self->Np)); /* of the plan */
    const hsep_real after_physics = (follows ? predict + newton + predict : 0.0) + last,
                    interior = work_interior(&sizes);
    hsep_real left = 0.0;
    switch ((hsep_trusted_stage)self->stage) {
    case HSEP_TRUSTED_DONE:
        return 0.0;
    case HSEP_TRUSTED_VARY:
        left = work_vary(&sizes, model, sizes.all - (hsep_real)self->varied);
        return left + work_begin(&sizes) + HSEP_TRUSTED_SOLVED * interior + after_physics;
    case HSEP_TRUSTED_BEGIN:
        return work_begin(&sizes) + HSEP_TRUSTED_SOLVED * interior + after_physics;
    case HSEP_TRUSTED_PHYSICS:
        return rest + (hsep_real)(HSEP_TRUSTED_SOLVED - solved) * interior + after_physics;
    case HSEP_TRUSTED_REST:
        return after_physics;
    case HSEP_TRUSTED_COLUMN:
        left = work_columns_left(self, &sizes, model, self->columns) + work_products(self, &sizes);
        break;
    case HSEP_TRUSTED_PRODUCT:
        left = work_products(self, &sizes);
        break;
    case HSEP_TRUSTED_BOUNDED:
        return rest + predict + work_newton_left(self, &sizes, model, solved) + predict + last;
    case HSEP_TRUSTED_JUDGE:
        left = predict;
        break;
    case HSEP_TRUSTED_COMPARE:
        return predict + last;
    case HSEP_TRUSTED_PREDICT:
        return last;
    case HSEP_TRUSTED_STEP:
    case HSEP_TRUSTED_TRY:
        break;
    }
    return left + newton + predict + last;
}

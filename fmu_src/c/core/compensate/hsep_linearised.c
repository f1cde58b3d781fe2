#include "hsep_linearised.h"

#include "hsep_vector.h"

#include <string.h>

#define LINEARISED_CHANGES 3                      /* signals of a change: v_d, x, v */
#define LINEARISED_DIFFERENCES 8                  /* most orders of differences of x_pb, it among them */
#define LINEARISED_GAINS (2 * LINEARISED_CHANGES) /* of an expert: of the disturbances, of their differences */

static const hsep_word linearised_experts[HSEP_LINEARISED_EXPERTS] = {HSEP_LAGGED, HSEP_STATIC, HSEP_DOUBTING};

#define LINEARISED_OF_COMMAND 2
static const hsep_word linearised_of_command[LINEARISED_OF_COMMAND] = {HSEP_COMMAND, HSEP_DOUBTING};

/* Weight of an expert in the stack; 0 where it knows nothing, or predicts the other residual. */
static hsep_real linearised_weight(const hsep_trusted *model, hsep_word expert, hsep_word kind)
{
    const int of_kind = hsep_trusted_kind_of(model, expert) == kind;
    return model->predicted[expert] && of_kind ? model->learned.stack.weights[expert] : 0.0;
}

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real linearised_lay_out(hsep_linearised *self, const hsep_residual_parameters *parameters)
{
    const hsep_real n = (hsep_real)parameters->n, preview = n - (hsep_real)parameters->settings->measurement_delay;
    const hsep_real filter = hsep_physics_size(parameters->n_modes, parameters->settings->dead_time);
    hsep_real end = HSEP_WORDS(hsep_linearised);
    self->n = parameters->n;
    self->preview = self->n - parameters->settings->measurement_delay;
    self->count = hsep_disturbances_count(parameters);
    self->slopes = hsep_take(&end, n * (hsep_real)self->count);
    self->gains = hsep_take(&end, n * LINEARISED_GAINS * HSEP_PHYSICS_ABREAST);
    self->shrink = hsep_take(&end, n * HSEP_LINEARISED_EXPERTS);
    self->kept = hsep_take(&end, n * LINEARISED_OF_COMMAND);
    self->change = hsep_take(&end, preview * LINEARISED_CHANGES);
    self->base = hsep_take(&end, preview);
    self->of_command = hsep_take(&end, preview * LINEARISED_OF_COMMAND);
    self->passed = hsep_take(&end, preview * HSEP_LINEARISED_EXPERTS);
    self->run = hsep_take(&end, preview);
    self->disturbance = hsep_take(&end, preview * HSEP_PHYSICS_ABREAST);
    self->drive = hsep_take(&end, preview * HSEP_PHYSICS_ABREAST);
    self->physics = hsep_take_block(&end, filter);
    self->filters = hsep_take_block(&end, HSEP_LINEARISED_EXPERTS * filter);
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_linearised_size(const hsep_residual_parameters *parameters)
{
    return linearised_lay_out(&(hsep_linearised){0}, parameters);
}

HSEP_API void hsep_linearised_init(hsep_linearised *self, const hsep_residual_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    memset(self, 0, (size_t)hsep_linearised_size(parameters)); /* gains of no expert are 0 */
    (void)linearised_lay_out(self, parameters);
    hsep_physics_init(
        (hsep_physics *)hsep_at(self, self->physics), parameters->modes, parameters->n_modes, settings->dead_time,
        settings->T_s, (hsep_hold)settings->input_hold);
}

HSEP_API int hsep_linearised_valid(const void *block, const hsep_residual_parameters *parameters)
{
    const hsep_word n_modes = parameters->n_modes, dead_time = parameters->settings->dead_time;
    hsep_linearised got;
    return HSEP_LAID_OUT(got, block, linearised_lay_out(&got, parameters)) &&
           hsep_physics_valid(hsep_at_bytes(block, got.physics), n_modes, dead_time);
}

/* Place of the weights of the disturbances among those of an expert. */
static hsep_word linearised_first(const hsep_linearised *self, const hsep_trusted *model)
{
    return model->n_static - 2 * self->count;
}

/* What the slopes give of a change, by the weights of an expert. gain: its first one of those abreast. */
static void linearised_gains(const hsep_linearised *self, const hsep_real weights[], hsep_real *gain)
{
    const hsep_real *slopes = hsep_at_const(self, self->slopes);
    const hsep_word n = self->n;
    for (hsep_word k = 0; k < n; k++, slopes += self->count) {
        for (hsep_word part = 0; part < 2; part++, gain += LINEARISED_CHANGES * HSEP_PHYSICS_ABREAST) {
            /* the disturbances, their differences */
            const hsep_real *w = weights + part * self->count;
            hsep_real friction = 0.0;
            hsep_real of_position = w[HSEP_DISTURBANCES_STIFFNESS] * slopes[HSEP_DISTURBANCES_STIFFNESS];
            for (hsep_word i = 0; i < HSEP_DISTURBANCES_N_FRICTION; i++) {
                friction += slopes[i] * w[i];
            }
            for (hsep_word i = HSEP_DISTURBANCES_N_LASTING; i < self->count; i++) {
                of_position += w[i] * slopes[i];
            }
            gain[0] = friction;
            gain[HSEP_PHYSICS_ABREAST] = of_position;
            gain[2 * HSEP_PHYSICS_ABREAST] = w[HSEP_DISTURBANCES_DAMPING] * slopes[HSEP_DISTURBANCES_DAMPING];
        }
    }
}

/* What the features of x_pb, it and its differences, give of a change behind G_pb. */
static void linearised_pass(
    const hsep_real weights[], hsep_word count, const hsep_real passed[], hsep_word n, hsep_real to[])
{
    hsep_real d[LINEARISED_DIFFERENCES] = {0.0}; /* of the sample before */
    for (hsep_word k = 0; k < n; k++) {
        hsep_real difference = passed[k];
        to[k] = 0.0;
        for (hsep_word i = 0; i < count; i++) {
            const hsep_real before = d[i];
            to[k] += weights[i] * difference;
            d[i] = difference;
            difference -= before;
        }
    }
}

/* A change after the dead time, at sample u. */
static hsep_real linearised_acted(const hsep_linearised_change *change, hsep_word u, hsep_word dead_time)
{
    return u >= dead_time && u - dead_time < change->n ? change->commands[u - dead_time] : 0.0;
}

/* A change as v_d, x and v. */
static void linearised_signals(hsep_linearised *self, const hsep_linearised_change *change, hsep_real T_s)
{
    hsep_real *signals = hsep_at(self, self->change), last_command = 0.0, last_passed = 0.0;
    for (hsep_word u = 0; u < self->preview; u++, signals += LINEARISED_CHANGES) {
        const hsep_real now = u < change->n ? change->commands[u] : 0.0;
        signals[0] = (now - last_command) / T_s;
        signals[1] = change->passed[u];
        signals[2] = (change->passed[u] - last_passed) / T_s;
        last_command = now, last_passed = change->passed[u];
    }
}

/* Part of an expert in the stack, sample after sample, with what shrinking and bounds leave of it. */
static void linearised_shrink(
    const hsep_linearised *self, hsep_trusted *model, hsep_word place, hsep_real weight, hsep_real shrink[])
{
    const hsep_expert *expert = hsep_trusted_expert(model, place);
    for (hsep_word k = 0; weight > 0.0 && k < self->n; k++) {
        shrink[k] = weight * hsep_expert_shrink(expert, self->n - 1 - k);
    }
}

/* What an expert of the command makes of the increments of a change, from rest, (preview,). */
static void linearised_of_increments(
    hsep_linearised *self, const hsep_expert *expert, const hsep_linearised_change *change, hsep_word dead_time,
    hsep_real to[])
{
    const hsep_real *weights = hsep_at_const(expert, expert->weights), *lag_weights = weights + expert->n_static;
    hsep_real *run = hsep_at(self, self->run);
    for (hsep_word u = 0; u < self->preview; u++) {
        hsep_real drive = 0.0;
        for (hsep_word i = 1; i < expert->n_static && i <= u + 1; i++) {
            const hsep_word at = u + 1 - i;
            const hsep_real before = at > 0 ? linearised_acted(change, at - 1, dead_time) : 0.0;
            drive += weights[i] * (linearised_acted(change, at, dead_time) - before);
        }
        hsep_real *e = run + (self->preview - 1 - u);
        *e = hsep_recur(drive, lag_weights, e + 1, u < expert->p ? u : expert->p);
        to[u] = *e;
    }
}

/* What of a change is neither friction nor stiffness: it behind G_pb and after the dead time, and what the experts of
 * the command make of it. */
static void linearised_command(hsep_linearised *self, hsep_trusted *model, const hsep_linearised_change *change)
{
    const hsep_word dead_time = hsep_trusted_command(model)->dead_time;
    hsep_real *base = hsep_at(self, self->base);
    memcpy(base, change->passed, (size_t)self->preview * sizeof(hsep_real));
    for (hsep_word i = 0; i < LINEARISED_OF_COMMAND; i++) {
        const hsep_word place = linearised_of_command[i];
        const hsep_real weight = linearised_weight(model, place, HSEP_OF_COMMAND);
        if (weight > 0.0) {
            linearised_shrink(self, model, place, weight, hsep_at(self, self->kept) + i * self->n);
            linearised_of_increments(
                self, hsep_trusted_expert(model, place), change, dead_time,
                hsep_at(self, self->of_command) + i * self->preview);
            for (hsep_word u = 0; u < self->preview; u++) {
                base[u] += weight * (linearised_acted(change, u, dead_time) - change->passed[u]);
            }
        }
    }
}

HSEP_API void hsep_linearised_at(
    hsep_linearised *self, hsep_trusted *model, const hsep_real x_d[], const hsep_real x_pb[],
    const hsep_linearised_change *change, hsep_real reach)
{
    const hsep_word n = self->n, first = linearised_first(self, model);
    hsep_disturbances_slopes(
        hsep_trusted_disturbances(model), x_d, x_pb, hsep_at(model, model->x), n, model->forecast_scale, reach,
        hsep_at(self, self->slopes));
    linearised_signals(self, change, hsep_trusted_disturbances(model)->T_s);
    linearised_command(self, model, change);
    for (hsep_word i = 0; i < HSEP_LINEARISED_EXPERTS; i++) {
        const hsep_expert *expert = hsep_trusted_expert(model, linearised_experts[i]);
        const hsep_real *weights = hsep_at_const(expert, expert->weights);
        if (hsep_trusted_kind_of(model, linearised_experts[i]) == HSEP_OF_COMMAND) {
            continue;
        }
        const hsep_real weight = linearised_weight(model, linearised_experts[i], HSEP_OF_PHYSICS);
        linearised_shrink(self, model, linearised_experts[i], weight, hsep_at(self, self->shrink) + i * n);
        linearised_gains(self, weights + first, hsep_at(self, self->gains) + i);
        linearised_pass(
            weights + 1, first - 1, change->passed, self->preview, hsep_at(self, self->passed) + i * self->preview);
    }
}

/* The disturbances that a change makes of each expert, in the last count samples. */
static void linearised_disturbance(hsep_linearised *self, hsep_word count)
{
    const hsep_word stride = LINEARISED_GAINS * HSEP_PHYSICS_ABREAST;
    const hsep_real *gain = hsep_at(self, self->gains) + (self->n - count) * stride;
    const hsep_real *change = hsep_at(self, self->change);
    hsep_real *disturbance = hsep_at(self, self->disturbance), last[HSEP_PHYSICS_ABREAST] = {0.0};
    for (hsep_word u = 0; u < count; u++, gain += stride, change += LINEARISED_CHANGES) {
        const hsep_real *of_difference = gain + stride / 2, v_d = change[0], x = change[1], v = change[2];
        for (hsep_word i = 0; i < HSEP_PHYSICS_ABREAST; i++) {
            const hsep_real difference = of_difference[i] * v_d + of_difference[HSEP_PHYSICS_ABREAST + i] * x +
                                         of_difference[2 * HSEP_PHYSICS_ABREAST + i] * v;
            *disturbance++ =
                (gain[i] * v_d + gain[HSEP_PHYSICS_ABREAST + i] * x + gain[2 * HSEP_PHYSICS_ABREAST + i] * v) +
                (difference - last[i]);
            last[i] = difference;
        }
    }
}

/* These behind G_pb, from rest. */
static void linearised_filter(hsep_linearised *self, hsep_word count)
{
    const hsep_word words = self->filters - self->physics;
    hsep_physics *filters[HSEP_LINEARISED_EXPERTS];
    for (hsep_word i = 0; i < HSEP_LINEARISED_EXPERTS; i++) {
        hsep_real *filter = hsep_at(self, self->filters + i * words);
        memcpy(filter, hsep_at(self, self->physics), (size_t)words * sizeof(hsep_real));
        filters[i] = (hsep_physics *)filter;
    }
    hsep_physics_abreast(
        filters, HSEP_LINEARISED_EXPERTS, hsep_at(self, self->disturbance), hsep_at(self, self->drive), (size_t)count);
}

/* Run of the recursion of expert i from rest, driven by the filtered disturbance and what the features of x_pb give,
 * and its part of the change of x_h. */
static void linearised_run(
    hsep_linearised *self, const hsep_expert *expert, hsep_word i, hsep_word count, hsep_real column[])
{
    const hsep_real *lag_weights = hsep_at_const(expert, expert->weights) + expert->n_static;
    const hsep_real *own = hsep_at(self, self->passed) + i * self->preview, *drive = hsep_at(self, self->drive) + i;
    const hsep_real *shrink = hsep_at(self, self->shrink) + i * self->n + (self->n - count);
    hsep_real *run = hsep_at(self, self->run);
    for (hsep_word u = 0; u < count; u++, drive += HSEP_PHYSICS_ABREAST) {
        hsep_real *e = run + (count - 1 - u);
        *e = hsep_recur(*drive + own[u], lag_weights, e + 1, u < expert->p ? u : expert->p);
        column[u] += shrink[u] * *e;
    }
}

HSEP_API void hsep_linearised_column(hsep_linearised *self, hsep_trusted *model, hsep_word first, hsep_real column[])
{
    const hsep_word count = self->preview - first;
    const hsep_real *of_command = hsep_at(self, self->of_command),
                    *kept = hsep_at(self, self->kept) + (self->n - count);
    memcpy(column, hsep_at(self, self->base), (size_t)count * sizeof(hsep_real));
    for (hsep_word i = 0; i < LINEARISED_OF_COMMAND; i++, kept += self->n, of_command += self->preview) {
        const int counts = linearised_weight(model, linearised_of_command[i], HSEP_OF_COMMAND) > 0.0;
        for (hsep_word u = 0; counts && u < count; u++) {
            column[u] += kept[u] * of_command[u];
        }
    }
    linearised_disturbance(self, count);
    linearised_filter(self, count);
    for (hsep_word i = 0; i < HSEP_LINEARISED_EXPERTS; i++) {
        if (linearised_weight(model, linearised_experts[i], HSEP_OF_PHYSICS) > 0.0) {
            linearised_run(self, hsep_trusted_expert(model, linearised_experts[i]), i, count, column);
        }
    }
}

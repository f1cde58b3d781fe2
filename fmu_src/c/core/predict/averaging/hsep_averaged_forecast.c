/* Prediction by an averaged residual model. */
#include "hsep_averaged_model.h"

/* Take the scales of velocity and command; return whether the commanded velocity outgrows what was learned. A
 * compensator begins to move before the path, with a creep: its first scale is the path's. */
static int averaged_outgrown(hsep_averaged *self, const hsep_real x_d[], const hsep_real path[], hsep_int n_path)
{
    const hsep_real before = self->learned.velocity_scale;
    const hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    hsep_real peak = hsep_disturbances_peak_velocity(disturbances, x_d, self->n);
    hsep_warm_start *evidence = hsep_averaged_evidence(self, HSEP_MODEL_RESIDUAL);
    const hsep_real n_windows = hsep_warm_start_earlier(evidence)->n_rows / (hsep_real)self->Np;
    hsep_real most = HSEP_AVERAGING_VELOCITY_JUMP * hsep_fmax(n_windows, 1.0) * before;
    self->forecast_step = hsep_fmax(self->learned.largest_step, peak * self->T_s);
    if (path != NULL && hsep_warm_start_n_rows(evidence) == 0.0) {
        const hsep_real step = hsep_disturbances_resolved(disturbances, hsep_largest_step(path, n_path));
        peak = hsep_fmax(step / self->T_s, before);
        most = before;
    }
    const int outgrown = peak > hsep_fmax(most, HSEP_FEATURES_LEAST_VELOCITY);
    self->forecast_scale = outgrown ? peak : before;
    return outgrown;
}

/* Fill the rows of the samples that come next, at x_pb. */
static void averaged_rows(hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[])
{
    hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    hsep_command *command = hsep_averaged_command(self);
    const hsep_real *late = hsep_command_late(command, self->n), scale = self->forecast_scale;
    hsep_real *rows = hsep_at(self, self->rows);
    hsep_command_take(command, x_d, self->n);
    hsep_disturbances_command(disturbances, x_d, late, x_pb, self->n, scale, rows);
    hsep_disturbances_motion(disturbances, x_pb, x_pb, self->n, 0, self->n, rows);
}

/* Take the scales of the features from the samples that come next; return as averaged_outgrown. */
static int averaged_scale(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_int n_path)
{
    const int outgrown = averaged_outgrown(self, x_d, path, n_path);
    hsep_real *rows = hsep_at(self, self->rows), *largest = hsep_at(self, self->forecast_largest);
    averaged_rows(self, x_d, x_pb);
    for (hsep_int i = 0; i < self->n_static; i++) {
        largest[i] = outgrown ? 0.0 : hsep_at(self, self->largest)[i];
    }
    for (hsep_int k = 0; k < self->n; k++, rows += self->n_static) {
        for (hsep_int i = 0; i < self->n_static; i++) {
            const hsep_real size = self->forecast_scale > 0.0 ? hsep_fabs(rows[i]) : 1.0; /* nothing has moved */
            largest[i] = size > largest[i] ? size : largest[i];
        }
    }
    return outgrown;
}

/* Prior standard deviations of the weights of an expert's features without lags, at most HSEP_AVERAGED_MOST. */
static void averaged_priors(hsep_averaged *self, hsep_int expert, hsep_real scales[])
{
    const hsep_int kind = hsep_averaged_kind_of(self, expert);
    const int of_command = kind == HSEP_COMMAND_RESIDUAL;
    const hsep_real step = self->forecast_step > 0.0 ? self->forecast_step : 1.0;
    const hsep_residual_scale *scale = &self->learned.scales[kind];
    const hsep_real effect = self->effect > 0.0 ? self->effect : hsep_residual_scale_effect(scale);
    const hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    hsep_expert *solved = hsep_averaged_expert(self, expert);
    for (hsep_int i = 0; i < solved->n_static; i++) {
        hsep_real largest = of_command ? step : hsep_at(self, self->forecast_largest)[i], share = 1.0;
        if (of_command && i == 0) {
            largest = 1.0;
        } else if (of_command) { /* an old increment explains less than a recent one, as an old residual does */
            share = i <= solved->p ? hsep_at(solved, solved->lag_scales)[i - 1] : hsep_sqrt(HSEP_AVERAGING_LAST_LAG);
        } else if (i + disturbances->count >= disturbances->n) {
            share = HSEP_AVERAGING_DIFFERENCE_SHARE;
        }
        scales[i] = effect * share / hsep_fmax(largest, HSEP_EXPERTS_LEAST);
    }
    scales[0] = self->effect > 0.0 ? self->effect : hsep_sqrt(scale->largest_square); /* makes up for an offset */
}

/* Solve for the weights of the experts that know something, from the rows of this run and of earlier ones. */
static void averaged_solve(hsep_averaged *self, int outgrown)
{
    int known[HSEP_N_RESIDUALS];
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        known[i] = hsep_warm_start_n_rows(hsep_averaged_evidence(self, i)) > 0.0 &&
                   self->learned.scales[i].largest_square > 0.0 && !(i == HSEP_MODEL_RESIDUAL && outgrown);
    }
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        self->predicted[i] = known[hsep_averaged_kind_of(self, i)] && hsep_averaged_solution(self, i) != NULL &&
                             hsep_averaged_expert(self, i)->variance > 0.0;
        if (self->predicted[i]) {
            hsep_warm_start *evidence = hsep_averaged_evidence(self, hsep_averaged_kind_of(self, i));
            const hsep_real earlier = hsep_expert_weight(i) * hsep_warm_start_earlier(evidence)->n_rows;
            const hsep_real n_rows = hsep_warm_start_of_run(evidence)->n_rows + earlier;
            hsep_real scales[HSEP_AVERAGED_MOST];
            averaged_priors(self, i, scales);
            (void)hsep_averaged_begun(self, i);
            hsep_expert_solve(hsep_averaged_expert(self, i), n_rows, scales);
        }
    }
}

/* Begin a prediction by the experts that know something. past: (p,) m, the last residuals of the physics model. */
static void averaged_begin(hsep_averaged *self, const hsep_real past[])
{
    const hsep_residual_scale *of_physics = &self->learned.scales[HSEP_MODEL_RESIDUAL];
    const hsep_residual_scale *of_command = &self->learned.scales[HSEP_COMMAND_RESIDUAL];
    const hsep_real *past_of_command = hsep_at(self, self->e_0) + self->Np, growth = self->growth;
    const hsep_real most = growth * of_command->largest, square = growth * growth * of_command->largest_square;
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        hsep_expert *expert = hsep_averaged_expert(self, i);
        if (self->predicted[i] && hsep_averaged_kind_of(self, i) == HSEP_COMMAND_RESIDUAL) {
            hsep_expert_begin(expert, past_of_command, square, HSEP_AVERAGING_BOUND * most);
        } else if (self->predicted[i]) {
            hsep_expert_begin(expert, past, of_physics->largest_square, self->bound);
        }
    }
}

/* What is held at places begin ... end - 1: the last residual, m, as long as the command does not turn. Experts of the
 * physics model's residual that know nothing, as before the first motion or a much faster one, hold it, too, and the
 * run's level where the command turns. */
static void averaged_hold(hsep_averaged *self, hsep_real last, hsep_int begin, hsep_int end)
{
    const hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    const hsep_real *rows = hsep_at(self, self->rows), hold = hsep_clip(last, self->bound);
    static const hsep_int known_later[] = {HSEP_ARX_RESIDUAL, HSEP_STATIC};
    hsep_real *stacked = hsep_at(self, self->stacked);
    for (hsep_int j = begin; j < end; j++) {
        const hsep_real *row = rows + (self->n - 1 - j) * disturbances->n;
        const hsep_real turned = hsep_disturbances_turned(disturbances, row);
        stacked[HSEP_HOLD * self->n + j] = hold * (1.0 - turned);
        for (hsep_int i = 0; i < 2; i++) {
            if (!self->predicted[known_later[i]]) {
                stacked[known_later[i] * self->n + j] = hold * (1.0 - turned) + self->level * turned;
            }
        }
    }
}

/* What an expert that has predicted adds to the physics model, m, at places begin ... end - 1. */
static void averaged_take(hsep_averaged *self, hsep_int place, const hsep_real x_pb[], hsep_int begin, hsep_int end)
{
    const hsep_expert *expert = hsep_averaged_expert(self, place);
    const hsep_real *late = hsep_command_late(hsep_averaged_command(self), self->n);
    const hsep_real *e_h = hsep_at_const(expert, expert->e_h), most = self->growth * self->bound;
    const int of_command = hsep_averaged_kind_of(self, place) == HSEP_COMMAND_RESIDUAL;
    hsep_real *stacked = hsep_at(self, self->stacked) + place * self->n;
    for (hsep_int j = begin; j < end; j++) {
        stacked[j] = of_command ? hsep_clip(e_h[j] + late[j] - x_pb[j], most) : e_h[j];
    }
}

/* Weights of the experts by one of the stacks: where nothing alike is recalled, the others share its weight. */
static void averaged_weigh(hsep_averaged *self, hsep_int place)
{
    const hsep_stack *stack = &self->learned.stacks[place];
    const hsep_real recalled = stack->weights[HSEP_RECALL];
    self->weighs = place;
    hsep_stack_others(stack, self->others);
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->shares[i] = stack->weights[i] + recalled * (1.0 - self->alike) * self->others[i];
    }
    self->shares[HSEP_RECALL] = recalled * self->alike;
}

/* How much counts what is recalled for the window. last: m, the last residual of the physics model. */
static void averaged_recall(hsep_averaged *self, hsep_real last)
{
    hsep_recall *recall = hsep_averaged_recall(self);
    const int moves = recall->same > 0.0 && self->predicted[HSEP_ARX_COMMAND];
    self->alike = hsep_recall_begin(
        recall, last, moves ? hsep_expert_weights(hsep_averaged_expert(self, HSEP_ARX_COMMAND)) + 1 : NULL);
    averaged_weigh(self, HSEP_OF_PREDICTIONS);
}

/* e: the stack of the experts, which have predicted the places begin ... end - 1. */
static void averaged_stack(hsep_averaged *self, hsep_real e[], hsep_int begin, hsep_int end)
{
    const hsep_real *weights = self->learned.stacks[self->weighs].weights, *recalled = hsep_at(self, self->recalled);
    hsep_real *stacked = hsep_at(self, self->stacked);
    hsep_real *variance = hsep_at(self, self->variance);
    for (hsep_int j = begin; j < end; j++) {
        hsep_real sum = 0.0, square = 0.0, others = 0.0;
        for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
            others += self->others[i] * stacked[i * self->n + j];
        }
        stacked[HSEP_RECALL * self->n + j] = self->alike * recalled[j] + (1.0 - self->alike) * others;
        for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
            const hsep_real predicted = stacked[i * self->n + j];
            hsep_real left = 0.0; /* of the variance of the residual */
            if (self->predicted[i]) {
                const hsep_expert *expert = hsep_averaged_expert(self, i);
                left = expert->largest_square * (1.0 - hsep_at_const(expert, expert->shrinkage)[j]);
            }
            sum += weights[i] * predicted;
            square += weights[i] * (predicted * predicted + left);
        }
        e[j] = hsep_at(self, self->e_h)[j] = sum;
        variance[j] = hsep_fmax(square - sum * sum, 0.0);
    }
}

HSEP_API void hsep_averaged_go_on(
    hsep_averaged *self, const hsep_real x_pb[], hsep_real e[], hsep_int first, hsep_int last, hsep_int stride)
{
    const hsep_int begin = self->n - last, end = self->n - first;
    hsep_real *x = hsep_at(self, self->x), *rows = hsep_at(self, self->rows);
    hsep_command *command = hsep_averaged_command(self);
    if (self->predicted[HSEP_STATIC]) { /* the rows hold stiffness and damping at x_pb: so they vary */
        hsep_expert *at_first = hsep_averaged_expert(self, HSEP_STATIC);
        hsep_expert_predict(at_first, rows, first, last, stride);
        for (hsep_int j = begin; j < end; j++) {
            x[j] = x_pb[j] + hsep_at(at_first, at_first->e_h)[j];
        }
        hsep_disturbances_motion(hsep_averaged_disturbances(self), x_pb, x, self->n, first, last, rows);
    }
    if (self->predicted[HSEP_ARX_COMMAND]) {
        hsep_command_fill(command, self->n, first, last);
    }
    hsep_recall_predict(
        hsep_averaged_recall(self), hsep_expert_weights(hsep_averaged_expert(self, HSEP_ARX_COMMAND)) + 1,
        hsep_command_late(command, self->n), x_pb, self->bound, self->growth * self->bound, first, last,
        hsep_at(self, self->recalled));
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        if (self->predicted[i]) {
            const int of_command = hsep_averaged_kind_of(self, i) == HSEP_COMMAND_RESIDUAL;
            const hsep_real *of_kind = of_command ? hsep_at(command, command->rows) : rows;
            hsep_expert_predict(hsep_averaged_expert(self, i), of_kind, first, last, i == HSEP_STATIC ? 0 : stride);
            averaged_take(self, i, x_pb, begin, end);
        }
    }
    averaged_hold(self, e[self->n], begin, end);
    averaged_stack(self, e, begin, end);
}

HSEP_API void hsep_averaged_weigh(hsep_averaged *self, hsep_int stack, hsep_real e[], hsep_int last)
{
    averaged_weigh(self, stack);
    averaged_stack(self, e, self->n - last, self->n);
}

HSEP_API void hsep_averaged_keep_ahead(hsep_averaged *self, int is_known)
{
    const hsep_int Np = self->Np, count = HSEP_N_EXPERTS * Np, last = self->n_ahead - 1;
    hsep_real *ahead = hsep_at(self, self->ahead);
    hsep_copy(ahead, ahead + count, last * count);
    ahead += last * count;
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        const hsep_real *stacked = hsep_at(self, self->stacked) + i * self->n + (self->n - self->n_ahead * Np);
        hsep_copy(ahead + i * Np, stacked, Np);
    }
    if (!is_known) {
        ahead[0] = (hsep_real)NAN;
    }
}

HSEP_API void hsep_averaged_forecast(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_int n_path,
    hsep_real e[], hsep_int last)
{
    const int outgrown = averaged_scale(self, x_d, x_pb, path, n_path);
    const hsep_real before = self->learned.largest_step;
    self->bound = HSEP_AVERAGING_BOUND * self->learned.scales[HSEP_MODEL_RESIDUAL].largest;
    self->growth = before > 0.0 ? hsep_fmin(self->forecast_step / before, HSEP_AVERAGING_VELOCITY_JUMP) : 1.0;
    averaged_solve(self, outgrown);
    hsep_zero(hsep_at(self, self->stacked), HSEP_N_EXPERTS * self->n);
    averaged_recall(self, e[self->n]);
    averaged_begin(self, e + self->n);
    hsep_averaged_go_on(self, x_pb, e, 0, last, 1); /* the scales left the rows at x_pb */
}

HSEP_API void hsep_averaged_predict(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_int last, hsep_int stride)
{
    averaged_rows(self, x_d, x_pb);
    averaged_begin(self, e + self->n);
    hsep_averaged_go_on(self, x_pb, e, 0, last, stride);
}

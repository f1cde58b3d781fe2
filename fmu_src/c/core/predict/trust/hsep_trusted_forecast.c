/* Prediction by a residual model that can be trusted. */
#include "hsep_trusted.h"

#include "hsep_math.h"
#include "hsep_predict_constants.h"
#include "hsep_range.h"
#include "hsep_trust_constants.h"

#include <stddef.h>

/* Those of the command's. */
#define TRUSTED_OF_COMMAND 2
static const hsep_expert_place trusted_experts_of_command[TRUSTED_OF_COMMAND] = {HSEP_COMMAND, HSEP_DOUBTING};

/* Whether an expert predicts the residual of the command from what it knows. */
static int trusted_predicts_command(const hsep_trusted *self, hsep_expert_place expert)
{
    return self->predicted[expert] && hsep_trusted_is_of_command(self, expert);
}

/* Whether the commanded velocity outgrows what was learned; the scales of velocity and command with it. A compensator
 * begins to move before the path, with a creep: its first scale is the path's. */
static int trusted_outgrown(hsep_trusted *self, const hsep_real x_d[], const hsep_real path[], hsep_word n_path)
{
    const hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    hsep_real peak = hsep_disturbances_peak_velocity(disturbances, x_d, self->n);
    const hsep_real n_rows = self->n_rows[HSEP_OF_PHYSICS] + self->n_earlier[HSEP_OF_PHYSICS];
    hsep_real most = HSEP_TRUST_OUTGROWN * self->velocity_scale;
    self->forecast_step = hsep_fmax(self->largest_step, peak * self->T_s);
    if (path != NULL && n_rows == 0.0) {
        peak = 0.0;
        for (hsep_word j = 0; j + 1 < n_path; j++) {
            peak = hsep_fmax(peak, hsep_fabs(path[j] - path[j + 1]));
        }
        peak = hsep_fmax(peak / self->T_s, self->velocity_scale);
        most = self->velocity_scale;
    }
    const int outgrown = peak > hsep_fmax(most, HSEP_DISTURBANCES_LEAST_VELOCITY);
    self->forecast_scale = outgrown ? peak : self->velocity_scale;
    return outgrown;
}

/* Largest magnitude of a feature of an expert, that of the window to predict included, and its share. */
static hsep_real trusted_largest(hsep_trusted *self, hsep_expert_place expert, hsep_word feature)
{
    if (hsep_trusted_is_of_command(self, expert)) {
        return feature > 0 ? self->forecast_step : 1.0;
    }
    return hsep_at(self, self->forecast_largest)[feature];
}

/* Solve for the weights of an expert from the rows of this run and of earlier ones, these weighed by weight. */
static void trusted_solve(hsep_trusted *self, hsep_expert_place place, hsep_real weight)
{
    const int of_command = hsep_trusted_is_of_command(self, place);
    const hsep_real square = of_command ? self->scale_of_command.largest_square : self->scale.largest_square;
    const hsep_real effect = self->effect > 0.0 ? self->effect : hsep_sqrt(square);
    const hsep_evidence evidence = of_command ? HSEP_OF_COMMAND : HSEP_OF_PHYSICS;
    const hsep_real n_earlier = self->n_earlier[evidence];
    hsep_expert *expert = hsep_trusted_expert(self, place);
    hsep_real *scales = hsep_at(self, self->scales);
    for (hsep_word i = 0; i < expert->n_static; i++) {
        const hsep_real share = of_command ? hsep_command_share(hsep_trusted_command(self), i)
                                           : hsep_disturbances_share(hsep_trusted_disturbances(self), i);
        scales[i] = effect * share / hsep_fmax(trusted_largest(self, place, i), HSEP_EXPERT_LEAST);
    }
    const hsep_expert_evidence solved = {
        .gram = hsep_trusted_evidence(self, evidence),
        .other = n_earlier > 0.0 ? hsep_trusted_earlier(self, evidence) : NULL,
        .weight = weight,
        .n_rows = self->n_rows[evidence] + weight * n_earlier,
        .scales = scales,
        .first = self->given_variance > 0.0 ? self->given_variance : HSEP_TRUST_FIRST_NOISE * square,
        .least = hsep_fmin(self->least_variance, HSEP_TRUST_LEAST_NOISE * square)};
    hsep_expert_solve(expert, &solved);
}

/* Solve for the weights of the experts of some evidence, the first one with lags, that know something. */
static void trusted_solve_of(hsep_trusted *self, const hsep_expert_place experts[], hsep_word count)
{
    for (hsep_word i = 0; self->predicted[experts[0]] && i < count; i++) {
        trusted_solve(self, experts[i], 1.0);
    }
    if (self->predicted[experts[0]] && self->leading == (hsep_word)experts[0] && self->predicted[HSEP_DOUBTING]) {
        trusted_solve(self, HSEP_DOUBTING, HSEP_TRUST_LESS);
    }
}

/* Largest step of the command relative to that before the window, >= 1, where its expert leads: it is linear in the
 * command, and may predict as much more than anything so far. */
static hsep_real trusted_growth(const hsep_trusted *self)
{
    if (!(self->largest_step > 0.0 && hsep_stack_leader(&self->stack) == HSEP_COMMAND)) {
        return 1.0;
    }
    return hsep_fmin(self->forecast_step / self->largest_step, HSEP_TRUST_GROWTH);
}

/* Take the scales of the features from the samples that come next, and solve for the weights. */
static void trusted_scale(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_word n_path,
    hsep_real last_residual)
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    const int outgrown = trusted_outgrown(self, x_d, path, n_path);
    hsep_real *rows = hsep_at(self, self->rows), *largest = hsep_at(self, self->forecast_largest);
    hsep_disturbances_command(disturbances, x_d, x_pb, self->n, self->forecast_scale, rows);
    hsep_disturbances_motion(disturbances, x_pb, x_pb, self->n, rows);
    for (hsep_word i = 0; i < self->n_static; i++) {
        largest[i] = outgrown ? 0.0 : hsep_at(self, self->largest)[i];
    }
    for (hsep_word k = 0; k < self->n; k++, rows += self->n_static) {
        for (hsep_word i = 0; i < self->n_static; i++) {
            const hsep_real size = hsep_fabs(rows[i]);
            largest[i] = size > largest[i] ? size : largest[i];
        }
    }
    self->bound = HSEP_TRUST_BOUND * self->scale.largest;
    self->growth = trusted_growth(self);
    self->hold = hsep_fmin(hsep_fmax(last_residual, -self->bound), self->bound);
    const hsep_real n_rows = self->n_rows[HSEP_OF_PHYSICS] + self->n_earlier[HSEP_OF_PHYSICS];
    const hsep_real n_of_command = self->n_rows[HSEP_OF_COMMAND] + self->n_earlier[HSEP_OF_COMMAND];
    const hsep_word known = n_rows > 0.0 && !outgrown && self->scale.largest_square > 0.0;
    self->predicted[HSEP_HOLD] = 1;
    self->predicted[HSEP_LAGGED] = self->predicted[HSEP_STATIC] = known;
    self->predicted[HSEP_COMMAND] = n_of_command > 0.0 && self->scale_of_command.largest_square > 0.0;
    self->predicted[HSEP_DOUBTING] = self->predicted[self->leading] && hsep_trusted_doubts(self);
    trusted_solve_of(self, (const hsep_expert_place[]){HSEP_LAGGED, HSEP_STATIC}, 2);
    trusted_solve_of(self, (const hsep_expert_place[]){HSEP_COMMAND}, 1);
}

/* What the experts of the command predict of the physics model's residual, at places begin ... end - 1. */
static void trusted_follow_command(hsep_trusted *self, const hsep_real x_pb[], hsep_word begin, hsep_word end)
{
    const hsep_real *late = hsep_command_late(hsep_trusted_command(self), self->n);
    hsep_real *stacked = hsep_at(self, self->stacked), most = self->growth * self->bound;
    for (hsep_word i = 0; i < TRUSTED_OF_COMMAND; i++, stacked += self->n) {
        const hsep_expert *expert = hsep_trusted_expert(self, trusted_experts_of_command[i]);
        const hsep_real *e_h = hsep_at_const(expert, expert->e_h);
        const int predicts = trusted_predicts_command(self, trusted_experts_of_command[i]);
        for (hsep_word j = begin; predicts && j < end; j++) {
            stacked[j] = hsep_clip(e_h[j] + late[j] - x_pb[j], most);
        }
    }
}

/* Largest mean square, m2, and bound, m, of an expert. */
static hsep_real trusted_square_of(hsep_trusted *self, hsep_word expert)
{
    return hsep_trusted_is_of_command(self, expert)
               ? self->growth * self->growth * self->scale_of_command.largest_square
               : self->scale.largest_square;
}

static hsep_real trusted_bound_of(hsep_trusted *self, hsep_word expert)
{
    return hsep_trusted_is_of_command(self, expert)
               ? HSEP_TRUST_BOUND_OF_COMMAND * (self->growth * self->scale_of_command.largest)
               : self->bound;
}

/* The last residuals before a window as an expert takes them. past: (p,) m, of the physics model. */
static const hsep_real *trusted_past_of(hsep_trusted *self, hsep_word expert, const hsep_real past[])
{
    return hsep_trusted_is_of_command(self, expert) ? hsep_at(self, self->e_0) + self->Np : past;
}

/* Predict by an expert. rows: features without lags. */
static void trusted_predict_by(
    hsep_trusted *self, hsep_expert_place expert, const hsep_real rows[], const hsep_real past[], hsep_word varied)
{
    hsep_expert_predict(
        hsep_trusted_expert(self, expert), rows, trusted_past_of(self, expert, past), trusted_square_of(self, expert),
        trusted_bound_of(self, expert), varied);
}

/* Predict by all experts that know something, whose rows hold the commands and stiffness and damping at x_pb. past:
 * (p,), m. */
static void trusted_by_experts(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real past[], hsep_word varied)
{
    hsep_command *command = hsep_trusted_command(self);
    hsep_real *x = hsep_at(self, self->x), *rows = hsep_at(self, self->rows);
    if (self->predicted[HSEP_STATIC]) {
        const hsep_expert *first = hsep_trusted_expert(self, HSEP_STATIC);
        trusted_predict_by(self, HSEP_STATIC, rows, past, varied > 0 ? self->n : 0);
        for (hsep_word j = 0; j < self->n; j++) {
            x[j] = x_pb[j] + hsep_at_const(first, first->e_h)[j];
        }
        hsep_disturbances_motion(hsep_trusted_disturbances(self), x_pb, x, self->n, rows);
    }
    if (self->predicted[HSEP_COMMAND]) {
        hsep_command_take(command, x_d, self->n);
    }
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (self->predicted[i]) {
            trusted_predict_by(
                self, (hsep_expert_place)i,
                hsep_trusted_is_of_command(self, i) ? hsep_at(command, command->rows) : rows, past, varied);
        }
    }
    trusted_follow_command(self, x_pb, 0, self->n);
}

HSEP_API hsep_real hsep_trusted_stacked(const hsep_trusted *self, hsep_expert_place expert, hsep_word place)
{
    if (!self->predicted[expert]) {
        return 0.0;
    }
    if (expert == HSEP_HOLD) {
        return self->hold;
    }
    if (hsep_trusted_is_of_command(self, expert)) {
        return hsep_at_const(self, self->stacked)[(expert == HSEP_COMMAND ? 0 : self->n) + place];
    }
    const hsep_expert *one = (const hsep_expert *)hsep_at_const(self, self->experts[expert]);
    return hsep_at_const(one, one->e_h)[place];
}

/* What is left of the variance of the residual where an expert predicts place j, m2. */
static hsep_real trusted_variance(const hsep_trusted *self, hsep_expert_place expert, hsep_word place)
{
    if (!self->predicted[expert] || expert == HSEP_HOLD) {
        return 0.0;
    }
    const hsep_expert *one = (const hsep_expert *)hsep_at_const(self, self->experts[expert]);
    return one->largest_square * (1.0 - hsep_at_const(one, one->kept)[place]);
}

/* e: the stack of the experts, which have predicted samples first ... last - 1. */
static void trusted_stack(hsep_trusted *self, hsep_real e[], hsep_word first, hsep_word last)
{
    const hsep_real *weights = self->stack.weights;
    hsep_real *variance = hsep_at(self, self->variance);
    for (hsep_word j = self->n - last; j < self->n - first; j++) {
        hsep_real sum = 0.0, square = 0.0;
        for (hsep_word i = 0; i < HSEP_N_EXPERTS; i++) {
            const hsep_real predicted = hsep_trusted_stacked(self, (hsep_expert_place)i, j);
            sum += weights[i] * predicted;
            square += weights[i] * (predicted * predicted + trusted_variance(self, (hsep_expert_place)i, j));
        }
        e[j] = sum;
        variance[j] = hsep_fmax(square - sum * sum, 0.0);
    }
}

HSEP_API void hsep_trusted_predict(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_word varied)
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    hsep_real *rows = hsep_at(self, self->rows);
    hsep_disturbances_command(disturbances, x_d, x_pb, self->n, self->forecast_scale, rows);
    hsep_disturbances_motion(disturbances, x_pb, x_pb, self->n, rows);
    trusted_by_experts(self, x_d, x_pb, e + self->n, varied);
    trusted_stack(self, e, 0, self->n);
}

HSEP_API void hsep_trusted_vary(hsep_trusted *self, hsep_word first, hsep_word last)
{
    hsep_command *command = hsep_trusted_command(self);
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        const int of_command = hsep_trusted_is_of_command(self, i);
        const hsep_real *rows = of_command ? hsep_at(command, command->rows) : hsep_at(self, self->rows);
        if (self->predicted[i]) {
            hsep_expert_vary(hsep_trusted_expert(self, (hsep_expert_place)i), rows, first, last);
        }
    }
}

/* Begin the prediction of a window part by part. */
static void trusted_begin(hsep_trusted *self, const hsep_real x_d[], const hsep_real past[])
{
    hsep_command_take_in(hsep_trusted_command(self), x_d, self->n);
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (self->predicted[i]) {
            hsep_expert_begin(
                hsep_trusted_expert(self, (hsep_expert_place)i), trusted_past_of(self, i, past),
                trusted_square_of(self, i), trusted_bound_of(self, i));
        }
    }
}

HSEP_API void hsep_trusted_forecast(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_word n_path,
    hsep_real e[], hsep_word last)
{
    trusted_scale(self, x_d, x_pb, path, n_path, e[self->n]);
    if (path == NULL) {
        trusted_begin(self, x_d, e + self->n);
        hsep_trusted_go_on(self, x_pb, e, 0, last);
    } else {
        trusted_by_experts(self, x_d, x_pb, e + self->n, last); /* the rows are those of the scales */
        trusted_stack(self, e, 0, last);
    }
}

HSEP_API void hsep_trusted_go_on(
    hsep_trusted *self, const hsep_real x_pb[], hsep_real e[], hsep_word first, hsep_word last)
{
    hsep_command *command = hsep_trusted_command(self);
    hsep_real *x = hsep_at(self, self->x), *rows = hsep_at(self, self->rows);
    if (self->predicted[HSEP_STATIC]) { /* the rows hold stiffness and damping at x_pb */
        hsep_expert *at_first = hsep_trusted_expert(self, HSEP_STATIC);
        hsep_expert_go_on(at_first, rows, first, last);
        for (hsep_word j = self->n - last; j < self->n - first; j++) {
            x[j] = x_pb[j] + hsep_at(at_first, at_first->e_h)[j];
        }
        hsep_disturbances_motion_of(hsep_trusted_disturbances(self), x_pb, x, self->n, first, last, rows);
    }
    if (self->predicted[HSEP_COMMAND]) {
        hsep_command_fill(command, self->n, first, last);
    }
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (self->predicted[i]) {
            hsep_expert_go_on(
                hsep_trusted_expert(self, (hsep_expert_place)i),
                hsep_trusted_is_of_command(self, i) ? hsep_at(command, command->rows) : rows, first, last);
        }
    }
    trusted_follow_command(self, x_pb, self->n - last, self->n - first);
    trusted_stack(self, e, first, last);
}

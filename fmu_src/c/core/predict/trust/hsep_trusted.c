/* Learning of a residual model that can be trusted. */
#include "hsep_trusted.h"

#include "hsep_math.h"
#include "hsep_predict_constants.h"
#include "hsep_trust_constants.h"

#include <stddef.h>
#include <string.h>

/* Take over what is known of the errors of another expert; NULL: nothing is. */
static void trusted_set_noise(hsep_trusted *self, hsep_expert_place of, const hsep_expert *other)
{
    hsep_expert *expert = hsep_trusted_expert(self, of);
    expert->noise_variance = other != NULL ? other->noise_variance : 0.0;
    expert->correlation = other != NULL ? other->correlation : 1.0;
}

HSEP_API void hsep_trusted_restart(hsep_trusted *self)
{
    hsep_trusted_begin_run(self, HSEP_OF_PHYSICS);
    hsep_trusted_begin_run(self, HSEP_OF_COMMAND);
    const hsep_expert_place leading = hsep_stack_leader(&self->stack);
    hsep_trusted_lead(self, leading);
    self->reach.n_missing = self->reach.n_beyond = 0;
    self->followed = self->known = 0;
    hsep_stack_forget(&self->stack, HSEP_DOUBTING);
    if (hsep_trusted_doubts(self)) {
        trusted_set_noise(self, HSEP_DOUBTING, hsep_trusted_expert(self, leading));
        hsep_stack_copy(&self->stack, leading, HSEP_DOUBTING);
    }
}

HSEP_API void hsep_trusted_measure(hsep_trusted *self, hsep_word k, hsep_real x)
{
    hsep_at(self, self->measured)[self->Np - 1 - k] = x;
}

/* Begin to follow a window: take over its scales, where rows at lower velocities are forgotten if it outgrows them. */
static void trusted_begin_window(hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[])
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    if (self->forecast_scale != self->velocity_scale) {
        hsep_trusted_forget(self, HSEP_OF_PHYSICS);
        hsep_trusted_believe_earlier(self, HSEP_OF_COMMAND);
        hsep_stack_forget(&self->stack, HSEP_DOUBTING);
    }
    self->velocity_scale = self->forecast_scale;
    self->largest_step = self->forecast_step;
    memcpy(
        hsep_at(self, self->largest), hsep_at(self, self->forecast_largest),
        (size_t)self->n_static * sizeof(hsep_real));
    self->reach_of_window =
        hsep_reach_begin(&self->reach, x_pb, disturbances->before.x_pb[0], self->Np, self->scale.largest);
    if (self->n > self->Np) { /* what was tried last went beyond the window */
        hsep_disturbances_command(disturbances, x_d, x_pb, self->Np, self->velocity_scale, hsep_at(self, self->rows));
    }
    hsep_command_take(hsep_trusted_command(self), x_d, self->Np);
    self->n_accepted = 0.0;
}

/* Features of the window up to sample last - 1 as they were measured, and the residual of the command: those before
 * known are there. */
static void trusted_take_rows(hsep_trusted *self, const hsep_real x_pb[], const hsep_real e[], hsep_word last)
{
    const hsep_word first = self->known, Np = self->Np;
    const hsep_real *late = hsep_command_late(hsep_trusted_command(self), Np);
    hsep_real *x = hsep_at(self, self->x), *e_0 = hsep_at(self, self->e_0);
    for (hsep_word j = Np - last; j < Np - first; j++) {
        x[j] = x_pb[j] + e[j];
        e_0[j] = x[j] - late[j];
    }
    if (first > 0) { /* the velocity at the first of them */
        x[Np - first] = x_pb[Np - first] + e[Np - first];
    }
    hsep_disturbances_motion_of(hsep_trusted_disturbances(self), x_pb, x, Np, first, last, hsep_at(self, self->rows));
    self->known = last;
}

/* Learn the row [features without lags | lags | residual] of sample k. Those with many lags that stand for samples
 * without a measurement are not. row: (n_static,); e: (Np + lags,), m. */
static void trusted_fold(
    hsep_trusted *self, hsep_evidence evidence, hsep_word k, const hsep_real row[], const hsep_real e[])
{
    hsep_gram *gram = hsep_trusted_evidence(self, evidence);
    const hsep_word p = evidence == HSEP_OF_COMMAND ? hsep_trusted_command(self)->p : self->p, n_static = gram->n - p;
    const hsep_real *bridged = hsep_at(self, self->bridged) + (self->Np - k), *lags = e + (self->Np - k);
    hsep_real n_bridged = 0.0, *to = hsep_gram_row(gram);
    for (hsep_word i = 0; i < p; i++) {
        n_bridged += bridged[i];
    }
    if (n_bridged > HSEP_TRUSTED_BRIDGED) {
        return;
    }
    memcpy(to, row, (size_t)n_static * sizeof(hsep_real));
    memcpy(to + n_static, lags, (size_t)p * sizeof(hsep_real));
    to[gram->n] = lags[-1];
    hsep_gram_fold(gram);
    self->n_rows[evidence] += 1.0;
}

/* Weight of all rows so far in this window: half, where more could not be counted without rounding. */
static hsep_real trusted_kept(const hsep_trusted *self, hsep_evidence evidence)
{
    return self->n_rows[evidence] < 0.5 * HSEP_EXACT ? self->kept : 0.5 * self->kept;
}

/* Judge the next sample, and take in those since the last one that is believed, if it is: their residuals are linear in
 * time between both. fold: whether it is learned. */
static void trusted_follow_sample(hsep_trusted *self, const hsep_real x_pb[], hsep_real e[], int fold)
{
    const hsep_word k = self->followed++, j = self->Np - 1 - k, known = self->Np - self->known;
    const hsep_real measured = hsep_at(self, self->measured)[j] - x_pb[j];
    const int accepted = hsep_reach_judge(&self->reach, &self->reach_of_window, measured, self->T_s);
    hsep_at(self, self->accepted)[j] = accepted ? 1.0 : 0.0;
    hsep_at(self, self->bridged)[j] = accepted ? 0.0 : 1.0;
    if (!accepted) {
        return;
    }
    e[j] = measured;
    const hsep_real slope = (e[j] - e[known]) / (hsep_real)(known - j);
    for (hsep_word i = known - 1; i > j; i--) {
        e[i] = slope * (hsep_real)(known - i) + e[known];
    }
    trusted_take_rows(self, x_pb, e, k + 1);
    if (fold) {
        hsep_command *command = hsep_trusted_command(self);
        if (!(self->n_accepted > 0.0)) {
            hsep_trusted_discount(self, HSEP_OF_PHYSICS, trusted_kept(self, HSEP_OF_PHYSICS));
            hsep_trusted_discount(self, HSEP_OF_COMMAND, trusted_kept(self, HSEP_OF_COMMAND));
        }
        trusted_fold(self, HSEP_OF_PHYSICS, k, hsep_at(self, self->rows) + k * self->n_static, e);
        trusted_fold(
            self, HSEP_OF_COMMAND, k, hsep_at(command, command->rows) + k * command->count, hsep_at(self, self->e_0));
    }
    self->n_accepted += 1.0;
}

HSEP_API void hsep_trusted_follow(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_word last)
{
    if (self->followed == 0 && last > 0) {
        trusted_begin_window(self, x_d, x_pb);
    }
    for (hsep_word i = 0; i < HSEP_TRUSTED_PACE && self->followed < last; i++) {
        trusted_follow_sample(self, x_pb, e, 1);
    }
    if (last + 1 == self->Np) { /* the solution comes with the next row */
        hsep_gram_settle(hsep_trusted_evidence(self, HSEP_OF_PHYSICS));
        hsep_gram_settle(hsep_trusted_evidence(self, HSEP_OF_COMMAND));
    }
}

/* Update the weights of the stack with the samples that were published, of those accepted. */
static void trusted_judge_stack(hsep_trusted *self, const hsep_real e[])
{
    const hsep_real *accepted = hsep_at(self, self->accepted);
    const hsep_word first = self->late < self->Np ? self->late : 0;
    hsep_real products[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1] = {{0.0}}, n = 0.0;
    for (hsep_word j = 0; j < self->Np - first; j++) {
        hsep_real of_sample[HSEP_N_EXPERTS + 1];
        if (!(accepted[j] > 0.0)) {
            continue;
        }
        for (hsep_word i = 0; i < HSEP_N_EXPERTS; i++) {
            of_sample[i] = hsep_trusted_stacked(self, (hsep_expert_place)i, self->n - self->Np + j);
        }
        of_sample[HSEP_N_EXPERTS] = e[j];
        for (int i = 0; i <= HSEP_N_EXPERTS; i++) {
            for (int l = i; l <= HSEP_N_EXPERTS; l++) {
                products[i][l] += of_sample[i] * of_sample[l];
            }
        }
        n += 1.0;
    }
    for (int i = 0; i <= HSEP_N_EXPERTS; i++) {
        for (int l = 0; l < i; l++) {
            products[i][l] = products[l][i];
        }
    }
    if (n > 0.0) {
        hsep_stack_update(&self->stack, products, n, self->least_variance);
    }
}

/* Let all experts go on with this run alone, and judge them anew. */
static void trusted_forget_earlier_runs(hsep_trusted *self)
{
    self->n_earlier[HSEP_OF_PHYSICS] = self->n_earlier[HSEP_OF_COMMAND] = 0.0;
    trusted_set_noise(self, HSEP_STATIC, NULL);
    trusted_set_noise(self, HSEP_LAGGED, NULL);
    trusted_set_noise(self, (hsep_expert_place)self->leading, hsep_trusted_expert(self, HSEP_DOUBTING));
    hsep_stack_init(&self->stack);
}

/* Judge the experts and their stack by the measurement of their window, of which count samples are learned. */
static void trusted_judge(hsep_trusted *self, const hsep_real e[], hsep_real count)
{
    const hsep_real *accepted = hsep_at(self, self->accepted), *e_0 = hsep_at(self, self->e_0);
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        if (self->predicted[i]) {
            hsep_expert_judge(
                hsep_trusted_expert(self, (hsep_expert_place)i), hsep_trusted_is_of_command(self, i) ? e_0 : e,
                accepted, self->given_variance);
        }
    }
    trusted_judge_stack(self, e);
    if (hsep_trusted_doubts(self) && self->stack.weights[HSEP_DOUBTING] > HSEP_TRUST_DOUBT) {
        trusted_forget_earlier_runs(self);
    }
    hsep_residual_scale_follow(&self->scale, e, accepted, self->Np, count);
    hsep_residual_scale_follow(&self->scale_of_command, e_0, accepted, self->Np, count);
}

HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[])
{
    const hsep_word Np = self->Np, dead_time = hsep_trusted_command(self)->dead_time;
    const hsep_real step = x_d[Np - 2] - x_d[Np - 1], step_pb = x_pb[Np - 2] - x_pb[Np - 1];
    hsep_real *past = hsep_at(self, self->e_0) + Np;
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    hsep_disturbances_restart(disturbances, x_d, x_pb, Np);
    hsep_disturbances_command(disturbances, x_d, x_pb, Np, self->forecast_scale, hsep_at(self, self->rows));
    hsep_command_begin(hsep_trusted_command(self), x_d[Np - 1], x_d[Np - 2]);
    for (hsep_word i = 0; i < hsep_trusted_command(self)->p; i++) {
        past[i] = (x_pb[Np - 1] - step_pb * (hsep_real)(i + 1)) - (x_d[Np - 1] - step * (hsep_real)(dead_time + i + 1));
    }
}

HSEP_API void hsep_trusted_learn(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], int fold)
{
    const hsep_word p = self->p, of_command = hsep_trusted_command(self)->p;
    hsep_real *bridged = hsep_at(self, self->bridged), *e_0 = hsep_at(self, self->e_0);
    if (self->followed == 0) {
        trusted_begin_window(self, x_d, x_pb);
    }
    while (self->followed < self->Np) {
        trusted_follow_sample(self, x_pb, e, fold);
    }
    if (self->known < self->Np) { /* none is believed behind it: its residual stays */
        const hsep_word known = self->Np - self->known;
        for (hsep_word j = 0; j < known; j++) {
            e[j] = e[known];
        }
        trusted_take_rows(self, x_pb, e, self->Np);
    }
    self->n_rejected += self->Np - (hsep_word)self->n_accepted;
    hsep_disturbances_end(hsep_trusted_disturbances(self));
    if (fold && self->n_accepted > 0.0) {
        trusted_judge(self, e, self->n_accepted);
    }
    hsep_command_end(hsep_trusted_command(self), self->Np);
    memmove(bridged + self->Np, bridged, (size_t)(p > of_command ? p : of_command) * sizeof(hsep_real));
    memmove(e_0 + self->Np, e_0, (size_t)of_command * sizeof(hsep_real));
    self->followed = self->known = 0;
}

/* Learning of a residual model that can be trusted. */
#include "hsep_trusted.h"

#include "hsep_predict_constants.h"
#include "hsep_trust_constants.h"
#include "hsep_wide.h"

#include <math.h>
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
    hsep_stack_forget(&self->stack, HSEP_DOUBTING);
    if (hsep_trusted_doubts(self)) {
        trusted_set_noise(self, HSEP_DOUBTING, hsep_trusted_expert(self, leading));
        hsep_stack_copy(&self->stack, leading, HSEP_DOUBTING);
    }
}

HSEP_API void hsep_trusted_measure(hsep_trusted *self, uint64_t k, double x)
{
    hsep_at(self, self->measured)[self->Np - 1 - k] = x;
}

/* The window's residuals, linear in time between accepted ones; return how many are accepted. */
static double trusted_bridge(hsep_trusted *self, const double x_pb[], double e[])
{
    const double *measured = hsep_at(self, self->measured), *accepted = hsep_at(self, self->accepted);
    double *bridged = hsep_at(self, self->bridged), count = 0.0;
    uint64_t known = self->Np; /* place of the last accepted residual, at first the one before the window */
    for (uint64_t j = self->Np; j-- > 0;) {
        bridged[j] = 1.0 - accepted[j];
        if (accepted[j] > 0.0) {
            e[j] = measured[j] - x_pb[j];
            const double slope = (e[j] - e[known]) / (double)(known - j);
            for (uint64_t i = known - 1; i > j; i--) {
                e[i] = slope * (double)(known - i) + e[known];
            }
            known = j;
            count += 1.0;
        }
    }
    for (uint64_t i = 0; i < known; i++) {
        e[i] = e[known];
    }
    return count;
}

/* Residual of the command over the window, whose commands and residuals are known. */
static void trusted_of_command(hsep_trusted *self, const double x_pb[], const double e[])
{
    const double *late = hsep_command_late(hsep_trusted_command(self), self->Np);
    double *e_0 = hsep_at(self, self->e_0);
    for (uint64_t j = 0; j < self->Np; j++) {
        e_0[j] = e[j] + x_pb[j] - late[j];
    }
}

/* Which rows of the window with p lags are learned, (Np,), by their places, and their number. Those with many lags that
 * stand for samples without a measurement are not. */
static uint64_t trusted_learned_rows(const hsep_trusted *self, uint64_t p, double learned[])
{
    const double *accepted = hsep_at_const(self, self->accepted);
    const double *bridged = hsep_at_const(self, self->bridged);
    double n_bridged = 0.0; /* among the lags of the row */
    uint64_t count = 0;
    for (uint64_t i = 0; i < p; i++) {
        n_bridged += bridged[self->Np + i];
    }
    for (uint64_t j = self->Np; j-- > 0;) {
        learned[j] = accepted[j] > 0.0 && n_bridged <= HSEP_TRUSTED_BRIDGED;
        count += learned[j] > 0.0;
        n_bridged += bridged[j] - bridged[j + p];
    }
    return count;
}

/* Update some evidence with the rows [features without lags | lags | residual] of the window that are learned.
 * rows: (Np, n_static); e: (Np + lags,), m. */
static void trusted_fold(hsep_trusted *self, hsep_evidence evidence, const double rows[], const double e[])
{
    hsep_regression *regression = hsep_trusted_evidence(self, evidence);
    const uint64_t n = regression->n, p = evidence == HSEP_OF_COMMAND ? hsep_trusted_command(self)->p : self->p;
    const uint64_t n_static = n - p;
    double *learned = hsep_at(self, self->x), *work = hsep_at(self, self->work); /* x is not needed any more */
    const uint64_t count = trusted_learned_rows(self, p, learned);
    uint64_t b = 0;
    hsep_trusted_discount(self, evidence, self->kept);
    for (uint64_t j = self->Np; j-- > 0; rows += n_static) {
        if (learned[j] > 0.0) {
            double *row = hsep_block_fold_row(work, n, b++);
            memcpy(row, rows, (size_t)n_static * sizeof(double));
            memcpy(row + n_static, e + j + 1, (size_t)p * sizeof(double));
            row[n] = e[j];
        }
    }
    hsep_block_fold(regression, work, count, 0, hsep_is_wide((double)count * (double)n * (double)n));
    self->n_rows[evidence] += (double)count;
}

/* Update all evidence with the window. */
static void trusted_fold_window(hsep_trusted *self, const double e[])
{
    hsep_command *command = hsep_trusted_command(self);
    trusted_fold(self, HSEP_OF_PHYSICS, hsep_at(self, self->rows), e);
    trusted_fold(self, HSEP_OF_COMMAND, hsep_at(command, command->rows), hsep_at(self, self->e_0));
}

/* Update the weights of the stack with the samples that were published, of those accepted. */
static void trusted_judge_stack(hsep_trusted *self, const double e[])
{
    const double *accepted = hsep_at(self, self->accepted);
    const uint64_t first = self->late < self->Np ? self->late : 0;
    double products[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1] = {{0.0}}, n = 0.0;
    for (uint64_t j = 0; j < self->Np - first; j++) {
        double of_sample[HSEP_N_EXPERTS + 1];
        for (uint64_t i = 0; i < HSEP_N_EXPERTS; i++) {
            of_sample[i] = hsep_trusted_stacked(self, (hsep_expert_place)i, self->n - self->Np + j);
        }
        of_sample[HSEP_N_EXPERTS] = e[j];
        for (int i = 0; accepted[j] > 0.0 && i <= HSEP_N_EXPERTS; i++) {
            for (int l = 0; l <= HSEP_N_EXPERTS; l++) {
                products[i][l] += of_sample[i] * of_sample[l];
            }
        }
        n += accepted[j];
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
static void trusted_judge(hsep_trusted *self, const double e[], double count)
{
    const double *accepted = hsep_at(self, self->accepted), *e_0 = hsep_at(self, self->e_0);
    for (uint64_t i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
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

HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const double x_d[], const double x_pb[])
{
    const uint64_t Np = self->Np, dead_time = hsep_trusted_command(self)->dead_time;
    const double step = x_d[Np - 2] - x_d[Np - 1], step_pb = x_pb[Np - 2] - x_pb[Np - 1];
    double *past = hsep_at(self, self->e_0) + Np;
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    hsep_disturbances_restart(disturbances, x_d, x_pb, Np);
    hsep_disturbances_command(disturbances, x_d, x_pb, Np, self->forecast_scale, hsep_at(self, self->rows));
    hsep_command_begin(hsep_trusted_command(self), x_d[Np - 1], x_d[Np - 2]);
    for (uint64_t i = 0; i < hsep_trusted_command(self)->p; i++) {
        past[i] = (x_pb[Np - 1] - step_pb * (double)(i + 1)) - (x_d[Np - 1] - step * (double)(dead_time + i + 1));
    }
}

/* Take over the scales of the window; rows at lower velocities are forgotten where it outgrows them. */
static void trusted_take_scales(hsep_trusted *self)
{
    if (self->forecast_scale != self->velocity_scale) {
        hsep_trusted_forget(self, HSEP_OF_PHYSICS);
        hsep_trusted_believe_earlier(self, HSEP_OF_COMMAND);
        hsep_stack_forget(&self->stack, HSEP_DOUBTING);
    }
    self->velocity_scale = self->forecast_scale;
    self->largest_step = self->forecast_step;
    memcpy(
        hsep_at(self, self->largest), hsep_at(self, self->forecast_largest), (size_t)self->n_static * sizeof(double));
}

/* Features of the window as it was measured, and the residual of the command. */
static void trusted_take_rows(hsep_trusted *self, const double x_d[], const double x_pb[], const double e[])
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    double *x = hsep_at(self, self->x), *rows = hsep_at(self, self->rows);
    for (uint64_t j = 0; j < self->Np; j++) {
        x[j] = x_pb[j] + e[j];
    }
    if (self->n > self->Np) { /* what was tried last went beyond the window */
        hsep_disturbances_command(disturbances, x_d, x_pb, self->Np, self->velocity_scale, rows);
    }
    hsep_disturbances_motion(disturbances, x_pb, x, self->Np, rows);
    hsep_disturbances_end(disturbances);
    hsep_command_take(hsep_trusted_command(self), x_d, self->Np);
    trusted_of_command(self, x_pb, e);
}

HSEP_API void hsep_trusted_learn(hsep_trusted *self, const double x_d[], const double x_pb[], double e[], int fold)
{
    const uint64_t p = self->p, of_command = hsep_trusted_command(self)->p;
    double *bridged = hsep_at(self, self->bridged), *e_0 = hsep_at(self, self->e_0);
    trusted_take_scales(self);
    hsep_reach_judge(
        &self->reach, hsep_at(self, self->measured), x_pb, hsep_trusted_disturbances(self)->before.x_pb[0], self->Np,
        self->scale.largest, self->T_s, hsep_at(self, self->accepted));
    const double count = trusted_bridge(self, x_pb, e);
    self->n_rejected += self->Np - (uint64_t)count;
    trusted_take_rows(self, x_d, x_pb, e);
    if (fold && count > 0.0) {
        trusted_fold_window(self, e);
        trusted_judge(self, e, count);
    }
    hsep_command_end(hsep_trusted_command(self), self->Np);
    memmove(bridged + self->Np, bridged, (size_t)(p > of_command ? p : of_command) * sizeof(double));
    memmove(e_0 + self->Np, e_0, (size_t)of_command * sizeof(double));
}

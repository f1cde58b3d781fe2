#include "hsep_linearised.h"

#include "hsep_vector.h"

#include <string.h>

#define LINEARISED_GAINS 6 /* signals of a candidate in gains: three of the disturbances, three of their differences */

/* Set what follows from the parameters; return the bytes of the block. */
static double linearised_lay_out(hsep_linearised *self, const hsep_trusted_parameters *parameters)
{
    const double n = (double)parameters->preview;
    const double filter = hsep_physics_size(parameters->n_modes, parameters->settings->dead_time);
    double end = HSEP_WORDS(hsep_linearised);
    self->n = parameters->preview;
    self->count = hsep_disturbances_count(parameters->trust->period);
    self->slopes = hsep_take(&end, n * (double)self->count);
    self->gains = hsep_take(&end, n * HSEP_N_CANDIDATES * LINEARISED_GAINS);
    self->shrink = hsep_take(&end, n * HSEP_N_CANDIDATES);
    self->passed = hsep_take(&end, n * HSEP_N_CANDIDATES);
    self->run = hsep_take(&end, n);
    self->drive = hsep_take(&end, n);
    self->physics = hsep_take_block(&end, filter);
    self->filter = hsep_take_block(&end, filter);
    return end * sizeof(double);
}

HSEP_API double hsep_linearised_size(const hsep_trusted_parameters *parameters)
{
    return linearised_lay_out(&(hsep_linearised){0}, parameters);
}

HSEP_API void hsep_linearised_init(hsep_linearised *self, const hsep_trusted_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    (void)linearised_lay_out(self, parameters);
    hsep_physics_init(
        (hsep_physics *)hsep_at(self, self->physics), parameters->modes, parameters->n_modes, settings->dead_time,
        settings->T_s, (hsep_hold)settings->input_hold);
    memcpy(
        hsep_at(self, self->filter), hsep_at(self, self->physics),
        (size_t)(self->filter - self->physics) * sizeof(double));
}

HSEP_API int hsep_linearised_valid(const void *block, const hsep_trusted_parameters *parameters)
{
    const uint64_t n_modes = parameters->n_modes, dead_time = parameters->settings->dead_time;
    hsep_linearised got;
    memcpy(&got, block, sizeof got);
    (void)linearised_lay_out(&got, parameters); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 &&
           hsep_physics_valid(hsep_at_bytes(block, got.physics), n_modes, dead_time) &&
           hsep_physics_valid(hsep_at_bytes(block, got.filter), n_modes, dead_time);
}

/* Place of the weights of the disturbances among those of a candidate. */
static uint64_t linearised_first(const hsep_linearised *self, const hsep_trusted *model)
{
    return model->n_static - 2 * self->count;
}

/* What the slopes give of a change, by the weights of a candidate. gains: (6, n). */
static void linearised_gains(const hsep_linearised *self, const double weights[], double gains[])
{
    const double *slopes = hsep_at_const(self, self->slopes);
    const uint64_t n = self->n;
    for (uint64_t k = 0; k < n; k++, slopes += self->count) {
        for (uint64_t part = 0; part < 2; part++) { /* the disturbances, their differences */
            const double *w = weights + part * self->count;
            double *gain = gains + 3 * part * n + k, friction = 0.0;
            double of_position = w[HSEP_DISTURBANCES_STIFFNESS] * slopes[HSEP_DISTURBANCES_STIFFNESS];
            for (uint64_t i = 0; i < HSEP_DISTURBANCES_FRICTION; i++) {
                friction += slopes[i] * w[i];
            }
            for (uint64_t i = HSEP_DISTURBANCES_PERIODIC; i < self->count; i++) {
                of_position += w[i] * slopes[i];
            }
            gain[0] = friction;
            gain[n] = of_position;
            gain[2 * n] = w[HSEP_DISTURBANCES_DAMPING] * slopes[HSEP_DISTURBANCES_DAMPING];
        }
    }
}

/* What the features of x_pb, it and its differences, give of a change behind G_pb. */
static void linearised_pass(const double weights[], uint64_t count, const double passed[], uint64_t n, double to[])
{
    double d[8] = {0.0}; /* differences of the sample before */
    for (uint64_t k = 0; k < n; k++) {
        double difference = passed[k];
        to[k] = 0.0;
        for (uint64_t i = 0; i < count; i++) {
            const double before = d[i];
            to[k] += weights[i] * difference;
            d[i] = difference;
            difference -= before;
        }
    }
}

HSEP_API void hsep_linearised_at(
    hsep_linearised *self, hsep_trusted *model, const double x_d[], const double x_pb[], const double passed[],
    double reach)
{
    const uint64_t n = self->n, first = linearised_first(self, model);
    hsep_disturbances_slopes(
        hsep_trusted_disturbances(model), x_d, x_pb, hsep_at(model, model->x), n, model->forecast_scale, reach,
        hsep_at(self, self->slopes));
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate *candidate = hsep_trusted_candidate(model, i);
        const double *weights = hsep_at(candidate, candidate->weights), part = model->blend.weights[1 + i];
        double *shrink = hsep_at(self, self->shrink) + i * n;
        for (uint64_t k = 0; k < n; k++) {
            shrink[k] = part * hsep_candidate_shrink(candidate, n - 1 - k);
        }
        linearised_gains(self, weights + first, hsep_at(self, self->gains) + i * n * LINEARISED_GAINS);
        linearised_pass(weights + 1, first - 1, passed, n, hsep_at(self, self->passed) + i * n);
    }
}

/* The disturbance that a change makes, in the last count samples, oldest first. */
static void linearised_disturbance(
    const hsep_linearised *self, const double gains[], const double change[], uint64_t n_change, const double passed[],
    uint64_t count, double T_s, double disturbance[])
{
    const uint64_t n = self->n;
    const double *gain = gains + (n - count);
    double last_change = 0.0, last_passed = 0.0, last_difference = 0.0;
    for (uint64_t u = 0; u < count; u++, gain++) {
        const double now = u < n_change ? change[u] : 0.0;
        const double v_d = (now - last_change) / T_s, v = (passed[u] - last_passed) / T_s;
        const double difference = gain[3 * n] * v_d + gain[4 * n] * passed[u] + gain[5 * n] * v;
        disturbance[u] = (gain[0] * v_d + gain[n] * passed[u] + gain[2 * n] * v) + (difference - last_difference);
        last_change = now, last_passed = passed[u], last_difference = difference;
    }
}

/* Run of the recursion of candidate i from rest, driven by the filtered disturbance and what the features of x_pb give,
 * and its part of the change of x_h. */
static void linearised_run(
    hsep_linearised *self, const hsep_candidate *candidate, uint64_t i, uint64_t count, double column[])
{
    const double *lag_weights = hsep_at_const(candidate, candidate->weights) + candidate->n_static;
    const double *own = hsep_at(self, self->passed) + i * self->n, *drive = hsep_at(self, self->drive);
    const double *shrink = hsep_at(self, self->shrink) + i * self->n + (self->n - count);
    double *run = hsep_at(self, self->run);
    for (uint64_t u = 0; u < count; u++) {
        double *e = run + (count - 1 - u);
        *e = hsep_recur(drive[u] + own[u], lag_weights, e + 1, u < candidate->p ? u : candidate->p);
        column[u] += shrink[u] * *e;
    }
}

HSEP_API void hsep_linearised_column(
    hsep_linearised *self, hsep_trusted *model, const double change[], uint64_t n_change, const double passed[],
    uint64_t first, double column[])
{
    const uint64_t n = self->n, count = n - first;
    const double T_s = hsep_trusted_disturbances(model)->T_s;
    hsep_physics *filter = (hsep_physics *)hsep_at(self, self->filter);
    double *drive = hsep_at(self, self->drive);
    memcpy(column, passed, (size_t)count * sizeof(double));
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        if (model->blend.weights[1 + i] > 0.0) {
            const double *gains = hsep_at(self, self->gains) + i * n * LINEARISED_GAINS;
            linearised_disturbance(self, gains, change, n_change, passed, count, T_s, drive);
            memcpy(filter, hsep_at(self, self->physics), (size_t)(self->filter - self->physics) * sizeof(double));
            hsep_physics_forced_response(filter, drive, drive, (size_t)count);
            linearised_run(self, hsep_trusted_candidate(model, i), i, count, column);
        }
    }
}

/* Learning of a residual model that can be trusted. */
#include "hsep_trusted.h"

#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Factor by which the mean square of the residual fades from window to window. */
static const double trusted_recent = 0.9;

/* Lags of a row that may stand for samples without a measurement. */
static const double trusted_bridged_max = 3.0;

/* Largest weight of earlier runs when another begins, in windows. */
static const double trusted_carried = 30.0;

/* Mean square error of a window, relative to the expected one, above which the machine has changed; and what then
 * remains at least of the weight of all samples before, in windows. */
static const double trusted_surprise = 10.0, trusted_surprised = 0.1;

/* Bound on the variance of the noise relative to the largest mean square of the residual: a larger one would prevent
 * any learning. */
static const double trusted_least_noise = 1e-4;

HSEP_API double hsep_trusted_least_variance(const hsep_trusted *self)
{
    return fmin(self->least_variance, trusted_least_noise * self->scale.largest_square);
}

/* Weigh all samples so far by kept. */
static void trusted_discount(hsep_trusted *self, double kept)
{
    if (kept < 1.0) {
        hsep_regression_discount(hsep_trusted_regression(self), kept);
        self->n_rows *= kept;
        if (hsep_trusted_change(self)->active) {
            hsep_change_discount(hsep_trusted_change(self), kept);
        }
    }
}

HSEP_API void hsep_trusted_restart(hsep_trusted *self)
{
    const double most = trusted_carried * (double)self->Np;
    hsep_change *change = hsep_trusted_change(self);
    change->active = 0;
    trusted_discount(self, most / fmax(self->n_rows, most));
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        self->correlations[i] = hsep_trusted_candidate(self, i)->correlation;
    }
    if (self->n_rows > 0.0) {
        hsep_change_begin(change, hsep_trusted_regression(self), self->n_rows);
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

/* Update the regression with the window's rows [features without lags | lags | e_pb]. */
static void trusted_fold(hsep_trusted *self, const double e[])
{
    hsep_regression *regression = hsep_trusted_regression(self);
    hsep_change *change = hsep_trusted_change(self);
    const uint64_t n_static = self->n_static;
    const double *rows = hsep_at(self, self->rows), *accepted = hsep_at(self, self->accepted);
    const double *bridged = hsep_at(self, self->bridged);
    double n_bridged = 0.0; /* among the lags of the row */
    for (uint64_t i = 0; i < self->p; i++) {
        n_bridged += bridged[self->Np + i];
    }
    trusted_discount(self, self->kept);
    for (uint64_t j = self->Np; j-- > 0; rows += n_static) {
        if (accepted[j] > 0.0 && n_bridged <= trusted_bridged_max) {
            double *row = change->active ? hsep_change_row(change) : hsep_regression_row(regression);
            memcpy(row, rows, (size_t)n_static * sizeof(double));
            memcpy(row + n_static, e + j + 1, (size_t)self->p * sizeof(double));
            row[n_static + self->p] = e[j];
            if (change->active) {
                hsep_change_fold(change);
            } else {
                hsep_regression_fold(regression);
            }
            self->n_rows += 1.0;
        }
        n_bridged += bridged[j] - bridged[j + self->p];
    }
    if (change->active) {
        hsep_change_join(change, regression);
    }
}

/* Variance of the noise from the first window: third differences leave white noise, 20 times its variance, and little
 * else. */
static double trusted_first_variance(const hsep_trusted *self, const double e[])
{
    double sum = 0.0;
    if (self->Np <= 10) {
        return hsep_dot(e, e, self->Np) / (double)self->Np;
    }
    for (uint64_t j = 0; j + 3 < self->Np; j++) {
        const double middle = e[j + 1] - e[j + 2];
        const double third = ((e[j] - e[j + 1]) - middle) - (middle - (e[j + 2] - e[j + 3]));
        sum += third * third;
    }
    return sum / (double)(self->Np - 3) / 20.0;
}

HSEP_API void hsep_trusted_predict_less(hsep_trusted *self, const double past[])
{
    hsep_change *change = hsep_trusted_change(self);
    change->doubted = 0;
    if (change->active && self->predicted && change->n_after > 0.0) {
        hsep_change_predict(
            change, hsep_trusted_candidate(self, 1), hsep_at(self, self->scales), hsep_trusted_least_variance(self),
            hsep_at(self, self->rows), past, &self->scale);
    }
}

/* Sum of squared errors of a prediction, of 0 if missing, over the accepted samples. */
static double trusted_error(const hsep_trusted *self, const double e[], const double predicted[])
{
    const double *accepted = hsep_at_const(self, self->accepted);
    double sum = 0.0;
    for (uint64_t j = 0; j < self->Np; j++) {
        const double error = e[j] - (predicted != NULL ? predicted[j] : 0.0);
        sum += accepted[j] * error * error;
    }
    return sum;
}

/* Whether earlier runs had better have less weight. */
static int trusted_is_doubted(hsep_trusted *self, const double e[])
{
    hsep_change *change = hsep_trusted_change(self);
    const double *all = hsep_candidate_prediction(hsep_trusted_candidate(self, 1));
    const double *less = hsep_candidate_prediction(hsep_change_candidate(change));
    const int compared = change->active && change->doubted && self->n_rest < self->Np;
    change->doubted = 0;
    return compared &&
           hsep_change_is_doubted(
               change, trusted_error(self, e, all), trusted_error(self, e, less), trusted_error(self, e, NULL));
}

/* Whether the plant of this run is another one than that of earlier runs. */
static int trusted_has_changed(hsep_trusted *self)
{
    hsep_change *change = hsep_trusted_change(self);
    const double least = hsep_trusted_least_variance(self);
    const hsep_candidate *first = hsep_trusted_candidate(self, 0);
    const double variance = fmax(first->noise_variance, least);
    const double correlation = fmin(self->correlations[0], first->correlation_max);
    return change->active && self->predicted &&
           hsep_change_tells(
               change, hsep_trusted_regression(self), hsep_at(self, self->scales), variance, least, correlation);
}

/* Forget what earlier runs have taught if the plant has changed, and end the comparison once it is decided. */
static void trusted_conclude(hsep_trusted *self, int changed, int doubted)
{
    hsep_change *change = hsep_trusted_change(self);
    if (doubted && !changed) {
        self->n_rows = hsep_change_doubt(change, hsep_trusted_regression(self));
    }
    if (changed) {
        self->n_rows = hsep_change_keep_after(change, hsep_trusted_regression(self));
        self->scale = (hsep_residual_scale){
            fmin(self->scale.recent, change->largest_square), change->largest_square, change->largest};
        hsep_blend_init(&self->blend);
        for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
            hsep_trusted_candidate(self, i)->correlation = self->correlations[i];
        }
    }
    if (changed || hsep_change_is_over(change)) {
        change->active = 0;
    }
}

/* Estimate the errors of the candidates from the measurement of their window, which may surprise. */
static void trusted_judge(hsep_trusted *self, double n_rows, const double e[], int surprises)
{
    const double *accepted = hsep_at(self, self->accepted);
    if (self->predicted) {
        const hsep_candidate *cautious = hsep_trusted_candidate(self, 1);
        const double surprise = hsep_candidate_surprise(cautious, e, accepted);
        if (surprises && surprise > trusted_surprise) {
            const double kept = trusted_surprise / surprise * (trusted_surprise / surprise);
            trusted_discount(self, fmax(kept, trusted_surprised * (double)self->Np / self->n_rows));
        }
    }
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate *candidate = hsep_trusted_candidate(self, i);
        double variance = 0.0;
        if (self->predicted) {
            hsep_candidate_judge(candidate, e, accepted);
            variance = candidate->residual_sum / n_rows;
        } else {
            variance = trusted_first_variance(self, e);
        }
        candidate->noise_variance = self->given_variance > 0.0 ? self->given_variance : variance;
    }
}

/* Scalar product of two signals over the accepted samples; a missing signal is 0. */
static double trusted_product(const hsep_trusted *self, const double a[], const double b[])
{
    const double *accepted = hsep_at_const(self, self->accepted);
    double sum = 0.0;
    for (uint64_t j = 0; a != NULL && b != NULL && j < self->Np; j++) {
        sum += accepted[j] * a[j] * b[j];
    }
    return sum;
}

/* Update the size of the residuals, and the blend of the candidates, with the accepted samples, count of them. */
static void trusted_assess(hsep_trusted *self, const double e[], double count)
{
    hsep_residual_scale *scale = &self->scale;
    const double *accepted = hsep_at(self, self->accepted);
    const double *signals[HSEP_N_BLENDED + 1] = {NULL};
    double products[HSEP_N_BLENDED + 1][HSEP_N_BLENDED + 1] = {{0.0}};
    const double mean_square = trusted_product(self, e, e) / count;
    double largest = 0.0;
    for (uint64_t j = 0; j < self->Np; j++) {
        largest = fmax(largest, accepted[j] * fabs(e[j]));
    }
    hsep_change_follow(hsep_trusted_change(self), mean_square, largest);
    scale->largest = fmax(scale->largest, largest);
    scale->recent =
        scale->recent > 0.0 ? trusted_recent * scale->recent + (1.0 - trusted_recent) * mean_square : mean_square;
    scale->largest_square = fmax(scale->largest_square, mean_square);
    signals[HSEP_N_BLENDED] = e;
    for (uint64_t i = 0; self->predicted && i < HSEP_N_CANDIDATES; i++) {
        signals[1 + i] = hsep_candidate_prediction(hsep_trusted_candidate(self, i));
    }
    for (uint64_t i = 1; i <= HSEP_N_BLENDED; i++) {
        double sum = 0.0;
        for (uint64_t j = 0; signals[i] != NULL && j < self->Np; j++) {
            sum += accepted[j] * signals[i][j];
        }
        products[0][i] = products[i][0] = self->hold * sum;
        for (uint64_t j = 1; j <= HSEP_N_BLENDED; j++) {
            products[i][j] = trusted_product(self, signals[i], signals[j]);
        }
    }
    products[0][0] = self->hold * self->hold * count;
    /* What was larger in earlier runs says nothing of the blend once this one outweighs them. */
    const hsep_change *change = hsep_trusted_change(self);
    const int outweighs = change->active && change->n_after > change->n_before;
    const double largest_square = outweighs ? change->largest_square : scale->largest_square;
    hsep_blend_update(&self->blend, products, largest_square, self->Np, self->n_rows);
}

HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const double x_d[], const double x_pb[])
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    hsep_disturbances_restart(disturbances, x_d, x_pb, self->Np);
    hsep_disturbances_command(disturbances, x_d, x_pb, self->Np, self->forecast_scale, hsep_at(self, self->rows));
}

HSEP_API void hsep_trusted_learn(hsep_trusted *self, const double x_d[], const double x_pb[], double e[], int fold)
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    double *x = hsep_at(self, self->x), *bridged = hsep_at(self, self->bridged);
    const double n_rows = self->n_rows;                 /* of the prediction */
    if (self->forecast_scale != self->velocity_scale) { /* outgrown */
        hsep_regression_init(hsep_trusted_regression(self), self->n_static + self->p, HSEP_NO_PENALTY);
        self->n_rows = 0.0;
        hsep_trusted_change(self)->active = 0;
    }
    self->velocity_scale = self->forecast_scale;
    memcpy(
        hsep_at(self, self->largest), hsep_at(self, self->forecast_largest), (size_t)self->n_static * sizeof(double));
    hsep_guard_accept(
        &self->guard, hsep_at(self, self->measured), x_pb, self->Np, self->scale.largest, x,
        hsep_at(self, self->accepted));
    const double count = trusted_bridge(self, x_pb, e);
    self->n_rejected += self->Np - (uint64_t)count;
    for (uint64_t j = 0; j < self->Np; j++) {
        x[j] = x_pb[j] + e[j];
    }
    if (self->n > self->Np) { /* what was tried last went beyond the window */
        hsep_disturbances_command(disturbances, x_d, x_pb, self->Np, self->velocity_scale, hsep_at(self, self->rows));
    }
    hsep_disturbances_motion(disturbances, x_pb, x, self->Np, hsep_at(self, self->rows));
    for (uint64_t k = 0; k < self->n_rest && k < self->Np; k++) { /* learned, but not used, at rest */
        hsep_at(self, self->rows)[k * self->n_static] = 1.0;
    }
    hsep_disturbances_end(disturbances);
    if (fold && count > 0.0) {
        trusted_fold(self, e);
        const int changed = trusted_has_changed(self);
        const int doubted = trusted_is_doubted(self, e);
        trusted_judge(self, n_rows, e, !changed && !doubted);
        trusted_assess(self, e, count);
        trusted_conclude(self, changed, doubted);
    }
    self->at_rest = self->n_rest >= self->Np;
    self->known_rest = self->n_rest > self->Np ? self->n_rest - self->Np : 0;
    memcpy(bridged + self->Np, bridged, (size_t)self->p * sizeof(double)); /* p <= Np: they do not overlap */
}

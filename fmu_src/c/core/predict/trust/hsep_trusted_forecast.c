/* Prediction by a residual model that can be trusted. */
#include "hsep_trusted.h"

#include <math.h>
#include <stddef.h>

/* Growth of the commanded velocity by which what was learned at lower ones is forgotten: the first one, as that was a
 * creep, and the second one when rows of so many windows are learned. */
static const double trusted_growth = 30.0, trusted_growth_learned = 1000.0, trusted_motion_learned = 15.0;

/* Velocity, m/s, below which a command is at rest: ratios of smaller ones may underflow. */
static const double trusted_least_velocity = 1e-200;

/* Bound on the last residual held, relative to the largest one. */
static const double trusted_hold_max = 1.2;

static const double trusted_least_magnitude = 1e-150; /* of a feature */

/* Whether the commanded velocity outgrows what was learned; the velocity scale with it. A compensator begins to move
 * before the path, with a creep: its first scale is the path's. */
static int trusted_outgrown(hsep_trusted *self, const double x_d[], const double path[], uint64_t n_path)
{
    const hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    double peak = hsep_disturbances_peak_velocity(disturbances, x_d, self->n);
    const int learned = self->n_rows >= trusted_motion_learned * (double)self->Np;
    double most = (learned ? trusted_growth_learned : trusted_growth) * self->velocity_scale;
    if (path != NULL && self->n_rows == 0.0) {
        peak = 0.0;
        for (uint64_t j = 0; j + 1 < n_path; j++) {
            peak = fmax(peak, fabs(path[j] - path[j + 1]));
        }
        peak = fmax(peak / disturbances->T_s, self->velocity_scale);
        most = self->velocity_scale;
    }
    const int outgrown = peak > fmax(most, trusted_least_velocity);
    self->forecast_scale = outgrown ? peak : self->velocity_scale;
    return outgrown;
}

/* How many of the next samples are before the first motion of the run. path: commands of the last n_path of them. */
static uint64_t trusted_rest_ahead(const hsep_trusted *self, const double path[], uint64_t n_path)
{
    const uint64_t late = self->n - n_path;
    uint64_t k = 0;
    if (!self->at_rest || self->known_rest < late) {
        return self->known_rest;
    }
    while (k < n_path && !(fabs(path[n_path - 1 - k]) > 0.0)) {
        k++;
    }
    return late + k;
}

/* Solve for the weights of the candidates. */
static void trusted_solve(hsep_trusted *self)
{
    const double effect = self->effect > 0.0 ? self->effect : sqrt(self->scale.largest_square);
    const double least = hsep_trusted_least_variance(self);
    const double *largest = hsep_at(self, self->forecast_largest);
    double *scales = hsep_at(self, self->scales);
    for (uint64_t i = 0; i < self->n_static; i++) {
        const double share = hsep_disturbances_share(hsep_trusted_disturbances(self), i);
        scales[i] = effect * share / fmax(largest[i], trusted_least_magnitude);
    }
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate_solve(hsep_trusted_candidate(self, i), hsep_trusted_regression(self), scales, least);
    }
}

HSEP_API void hsep_trusted_scale(
    hsep_trusted *self, const double x_d[], const double x_pb[], const double path[], uint64_t n_path,
    double last_residual)
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    const double bound = trusted_hold_max * self->scale.largest;
    const int outgrown = trusted_outgrown(self, x_d, path, n_path);
    double *rows = hsep_at(self, self->rows), *largest = hsep_at(self, self->forecast_largest);
    hsep_disturbances_command(disturbances, x_d, x_pb, self->n, self->forecast_scale, rows);
    hsep_disturbances_motion(disturbances, x_pb, x_pb, self->n, rows);
    for (uint64_t i = 0; i < self->n_static; i++) {
        largest[i] = outgrown ? 0.0 : hsep_at(self, self->largest)[i];
    }
    for (uint64_t k = 0; k < self->n; k++, rows += self->n_static) {
        for (uint64_t i = 0; i < self->n_static; i++) {
            largest[i] = fmax(largest[i], fabs(rows[i]));
        }
    }
    self->n_rest = trusted_rest_ahead(self, path != NULL ? path : x_d, path != NULL ? n_path : self->n);
    self->hold = fmin(fmax(last_residual, -bound), bound);
    self->predicted = self->n_rows > 0.0 && !outgrown && self->scale.largest_square > 0.0;
    if (self->predicted) {
        trusted_solve(self);
    }
}

/* Predict by the candidates, if they have learned, whose rows hold the commands and stiffness and damping at x_pb.
 * past: (p,), m. */
static void trusted_candidates(hsep_trusted *self, const double x_pb[], const double past[], uint64_t varied)
{
    if (!self->predicted) {
        return;
    }
    double *x = hsep_at(self, self->x), *rows = hsep_at(self, self->rows);
    hsep_candidate *first = hsep_trusted_candidate(self, 0);
    const uint64_t n_rest = hsep_trusted_change(self)->active ? self->n_rest : 0;
    for (uint64_t k = 0; k < n_rest; k++) { /* the constant that earlier runs have taught is that of motion */
        rows[k * self->n_static] = 0.0;
    }
    /* The stiffness acts at the position, which the physics model alone does not give well enough. */
    hsep_candidate_predict(first, rows, past, &self->scale, varied > 0 ? self->n : 0);
    for (uint64_t j = 0; j < self->n; j++) {
        x[j] = x_pb[j] + hsep_at(first, first->e_h)[j];
    }
    hsep_disturbances_motion(hsep_trusted_disturbances(self), x_pb, x, self->n, rows);
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate_predict(hsep_trusted_candidate(self, i), rows, past, &self->scale, varied);
    }
}

/* e: the blend of the candidates, which have predicted samples first ... last - 1. */
static void trusted_blend(hsep_trusted *self, double e[], uint64_t first, uint64_t last)
{
    const double *weights = self->blend.weights;
    double *disagreement = hsep_at(self, self->disagreement);
    for (uint64_t j = self->n - last; j < self->n - first; j++) {
        double square = weights[0] * self->hold * self->hold;
        e[j] = weights[0] * self->hold;
        for (uint64_t i = 0; self->predicted && i < HSEP_N_CANDIDATES; i++) {
            hsep_candidate *one = hsep_trusted_candidate(self, i);
            const double candidate = hsep_at(one, one->e_h)[j];
            e[j] += weights[1 + i] * candidate;
            square += weights[1 + i] * candidate * candidate;
        }
        disagreement[j] = fmax(square - e[j] * e[j], 0.0);
    }
}

HSEP_API void hsep_trusted_predict(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t varied)
{
    hsep_disturbances *disturbances = hsep_trusted_disturbances(self);
    double *rows = hsep_at(self, self->rows);
    hsep_disturbances_command(disturbances, x_d, x_pb, self->n, self->forecast_scale, rows);
    hsep_disturbances_motion(disturbances, x_pb, x_pb, self->n, rows);
    trusted_candidates(self, x_pb, e + self->n, varied);
    trusted_blend(self, e, 0, self->n);
}

HSEP_API void hsep_trusted_vary(hsep_trusted *self, uint64_t first, uint64_t last)
{
    for (uint64_t i = 0; self->predicted && i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate_vary(hsep_trusted_candidate(self, i), hsep_at(self, self->rows), &self->scale, first, last);
    }
}

HSEP_API void hsep_trusted_forecast(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t last)
{
    hsep_trusted_scale(self, x_d, x_pb, NULL, 0, e[self->n]);
    trusted_candidates(self, x_pb, e + self->n, last); /* the rows are those of the scales */
    trusted_blend(self, e, 0, last);
}

HSEP_API void hsep_trusted_go_on(hsep_trusted *self, double e[], uint64_t first, uint64_t last)
{
    for (uint64_t i = 0; self->predicted && i < HSEP_N_CANDIDATES; i++) {
        hsep_candidate_go_on(hsep_trusted_candidate(self, i), hsep_at(self, self->rows), &self->scale, first, last);
    }
    trusted_blend(self, e, first, last);
}

/* Memory of a residual model that can be trusted: its layout, beginning and check, and what it has learned. */
#include "hsep_trusted.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

HSEP_API hsep_disturbances *hsep_trusted_disturbances(hsep_trusted *self)
{
    return (hsep_disturbances *)hsep_at(self, self->disturbances);
}

HSEP_API hsep_regression *hsep_trusted_regression(hsep_trusted *self)
{
    return (hsep_regression *)hsep_at(self, self->regression);
}

HSEP_API hsep_change *hsep_trusted_change(hsep_trusted *self) { return (hsep_change *)hsep_at(self, self->change); }

HSEP_API hsep_candidate *hsep_trusted_candidate(hsep_trusted *self, uint64_t i)
{
    return (hsep_candidate *)hsep_at(self, self->candidates[i]);
}

HSEP_API uint64_t hsep_trusted_n(const hsep_predictor_settings *settings, const hsep_trust_settings *trust)
{
    return hsep_disturbances_n(settings->q, trust->period) + settings->p;
}

/* Correlation beyond which the penalty of a cautious candidate does not grow: it would learn nothing at all. */
static const double trusted_cautious = 100.0;

/* The last candidate takes the rows as independent: it learns fastest where G_pb is wrong. */
static hsep_candidate_shape trusted_shape(const hsep_trusted *self, uint64_t candidate)
{
    return (hsep_candidate_shape){
        self->Np, self->n, self->n_static, candidate > 0 ? self->p : 0, candidate > 1 ? 1.0 : trusted_cautious};
}

/* The candidate that predicts windows, no more, with less weight of earlier runs. */
static hsep_candidate_shape trusted_doubtful_shape(const hsep_trusted *self)
{
    return (hsep_candidate_shape){self->Np, self->Np, self->n_static, self->p, trusted_cautious};
}

/* Set what follows from the parameters; return the bytes of the block. */
static double trusted_lay_out(hsep_trusted *self, const hsep_trusted_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    const hsep_trust_settings *trust = parameters->trust;
    const double Np = (double)settings->Np, n = (double)parameters->n;
    const double n_static = (double)hsep_disturbances_n(settings->q, trust->period);
    double end = HSEP_WORDS(hsep_trusted);
    self->Np = settings->Np;
    self->n = parameters->n;
    self->p = settings->p;
    self->n_static = hsep_disturbances_n(settings->q, trust->period);
    self->least_variance = settings->lambda;
    self->effect = trust->effect;
    self->given_variance = trust->noise_std * trust->noise_std;
    self->kept = trust->forgetting > 0.0 ? exp(-Np * settings->T_s / trust->forgetting) : 1.0;
    self->largest = hsep_take(&end, n_static);
    self->forecast_largest = hsep_take(&end, n_static);
    self->scales = hsep_take(&end, n_static);
    self->x = hsep_take(&end, n);
    self->measured = hsep_take(&end, Np);
    self->accepted = hsep_take(&end, Np);
    self->bridged = hsep_take(&end, Np + (double)settings->p);
    self->disagreement = hsep_take(&end, n);
    self->rows = hsep_take(&end, n * n_static);
    self->disturbances = hsep_take_block(&end, hsep_disturbances_size(settings, trust->period, parameters->n_modes));
    self->regression = hsep_take_block(&end, hsep_regression_size(hsep_trusted_n(settings, trust)));
    const hsep_candidate_shape doubtful = trusted_doubtful_shape(self);
    self->change = hsep_take_block(&end, hsep_change_size(&doubtful));
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        const hsep_candidate_shape shape = trusted_shape(self, i);
        self->candidates[i] = hsep_take_block(&end, hsep_candidate_size(&shape));
    }
    return end * sizeof(double);
}

HSEP_API double hsep_trusted_size(const hsep_trusted_parameters *parameters)
{
    return trusted_lay_out(&(hsep_trusted){0}, parameters);
}

HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_trusted_parameters *parameters, double start)
{
    memset(self, 0, (size_t)hsep_trusted_size(parameters));
    (void)trusted_lay_out(self, parameters);
    self->at_rest = 1;
    self->known_rest = parameters->settings->measurement_delay;
    hsep_blend_init(&self->blend);
    hsep_guard_init(&self->guard, 2 * self->Np);
    hsep_disturbances_init(
        hsep_trusted_disturbances(self), parameters->settings, parameters->trust->period, parameters->modes,
        parameters->n_modes, parameters->planned, start);
    hsep_regression_init(hsep_trusted_regression(self), self->n_static + self->p, HSEP_NO_PENALTY);
    const hsep_candidate_shape doubtful = trusted_doubtful_shape(self);
    hsep_change_init(hsep_trusted_change(self), &doubtful);
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        const hsep_candidate_shape shape = trusted_shape(self, i);
        hsep_candidate_init(hsep_trusted_candidate(self, i), &shape);
    }
}

HSEP_API int hsep_trusted_valid(const void *block, const hsep_trusted_parameters *parameters)
{
    hsep_trusted got;
    memcpy(&got, block, sizeof got);
    (void)trusted_lay_out(&got, parameters); /* changes nothing where it is sound */
    const hsep_candidate_shape doubtful = trusted_doubtful_shape(&got);
    int sound = memcmp(&got, block, sizeof got) == 0 && got.predicted <= 1 && got.at_rest <= 1 &&
                got.known_rest <= got.n && got.n_rest <= got.n && got.guard.patience == 2 * got.Np &&
                hsep_disturbances_valid(
                    hsep_at_bytes(block, got.disturbances), parameters->settings, parameters->trust->period,
                    parameters->n_modes, parameters->planned) &&
                hsep_regression_valid(hsep_at_bytes(block, got.regression), got.n_static + got.p) &&
                hsep_change_valid(hsep_at_bytes(block, got.change), &doubtful);
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        const void *candidate = hsep_at_bytes(block, got.candidates[i]);
        const hsep_candidate_shape shape = trusted_shape(&got, i);
        sound = sound && hsep_candidate_valid(candidate, &shape);
    }
    return sound;
}

#define TRUSTED_N_SENSOR 4 /* numbers of what is known of the sensor, the last ones */

HSEP_API uint64_t hsep_trusted_n_learned(const hsep_trusted *self)
{
    return 2 + 3 + 2 * HSEP_N_CANDIDATES + self->n_static + HSEP_N_BLENDED * (HSEP_N_BLENDED + 2) + TRUSTED_N_SENSOR;
}

HSEP_API double *hsep_trusted_learned(hsep_trusted *self, uint64_t i)
{
    struct {
        double *first;
        uint64_t n;
    } const parts[] = {
        {&self->n_rows, 1},
        {&self->velocity_scale, 1},
        {&self->scale.recent, 1},
        {&self->scale.largest_square, 1},
        {&self->scale.largest, 1},
        {&hsep_trusted_candidate(self, 0)->noise_variance, 1},
        {&hsep_trusted_candidate(self, 1)->noise_variance, 1},
        {&hsep_trusted_candidate(self, 2)->noise_variance, 1},
        {&hsep_trusted_candidate(self, 0)->correlation, 1},
        {&hsep_trusted_candidate(self, 1)->correlation, 1},
        {&hsep_trusted_candidate(self, 2)->correlation, 1},
        {self->blend.weights, HSEP_N_BLENDED},
        {hsep_at(self, self->largest), self->n_static},
        {self->blend.gram, HSEP_N_BLENDED * HSEP_N_BLENDED},
        {self->blend.cross, HSEP_N_BLENDED},
        {&self->guard.spread, 1},
        {&self->guard.held.step, 1},
        {&self->guard.stuck, 1},
        {&self->guard.vibration, 1},
    };
    size_t part = 0;
    for (; i >= parts[part].n; part++) {
        i -= parts[part].n;
    }
    return parts[part].first + i;
}

HSEP_API int hsep_trusted_sound(hsep_trusted *self)
{
    const uint64_t n = hsep_trusted_n_learned(self) - TRUSTED_N_SENSOR;
    const uint64_t n_signed = HSEP_N_BLENDED * (HSEP_N_BLENDED + 1);
    const double spread = self->guard.spread, stuck = self->guard.stuck, vibration = self->guard.vibration;
    int sound = self->guard.held.step > 0.0 && (spread == -1.0 || (spread >= 0.0 && isfinite(spread))) &&
                stuck >= 0.0 && isfinite(stuck) && vibration >= 0.0 && isfinite(vibration);
    for (uint64_t i = 0; i < HSEP_N_CANDIDATES; i++) {
        sound = sound && hsep_trusted_candidate(self, i)->correlation >= 1.0;
    }
    for (uint64_t i = 0; i < n; i++) {
        const double learned = *hsep_trusted_learned(self, i);
        sound = sound && isfinite(learned) && (i + n_signed >= n || learned >= 0.0);
    }
    return sound;
}

#include "hsep_disturbances.h"

#include <math.h>
#include <string.h>

#define DISTURBANCES_FRICTION 6 /* the first ones */
#define DISTURBANCES_STIFFNESS 6
#define DISTURBANCES_DAMPING 7
#define DISTURBANCES_DIFFERENCES 3

/* Velocities v_i of the friction's change of sign, relative to the velocity scale. */
static const double disturbances_spread[DISTURBANCES_FRICTION] = {0.01, 0.03, 0.1, 0.3, 1.0, 3.0};

/* Effect of a disturbance's first difference relative to its own: they only correct its timing. */
static const double disturbances_difference_share = 0.03;

HSEP_API uint64_t hsep_disturbances_n(uint64_t q)
{
    return 2 + (q < DISTURBANCES_DIFFERENCES ? q : DISTURBANCES_DIFFERENCES) + 2 * HSEP_N_DISTURBANCES;
}

HSEP_API double hsep_disturbances_share(const hsep_disturbances *self, uint64_t feature)
{
    return feature + HSEP_N_DISTURBANCES < self->n ? 1.0 : disturbances_difference_share;
}

static hsep_physics *disturbances_filter(hsep_disturbances *self, uint64_t i)
{
    return (hsep_physics *)hsep_at(self, self->filters + i * self->filter_words);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double disturbances_lay_out(
    hsep_disturbances *self, const hsep_predictor_settings *settings, uint64_t n_modes, uint64_t late)
{
    const double filter = hsep_physics_size(n_modes, settings->dead_time);
    double end = HSEP_WORDS(hsep_disturbances);
    self->Np = settings->Np;
    self->n_ahead = settings->Np + late;
    self->n = hsep_disturbances_n(settings->q);
    self->n_differences = self->n - 2 - 2 * HSEP_N_DISTURBANCES;
    self->T_s = settings->T_s;
    self->filters = hsep_take_block(&end, HSEP_N_DISTURBANCES * filter);
    self->trial = hsep_take_block(&end, filter);
    self->beyond = hsep_take_block(&end, filter);
    self->filter_words = (self->trial - self->filters) / HSEP_N_DISTURBANCES;
    return end * sizeof(double);
}

HSEP_API double hsep_disturbances_size(const hsep_predictor_settings *settings, uint64_t n_modes, uint64_t late)
{
    return disturbances_lay_out(&(hsep_disturbances){0}, settings, n_modes, late);
}

HSEP_API void hsep_disturbances_init(
    hsep_disturbances *self, const hsep_predictor_settings *settings, const hsep_mode modes[], uint64_t n_modes,
    uint64_t late)
{
    memset(self, 0, (size_t)hsep_disturbances_size(settings, n_modes, late));
    (void)disturbances_lay_out(self, settings, n_modes, late);
    for (uint64_t i = 0; i < HSEP_N_DISTURBANCES + 2; i++) { /* those tried behind them */
        hsep_physics_init(
            disturbances_filter(self, i), modes, n_modes, settings->dead_time, settings->T_s,
            (hsep_hold)settings->input_hold);
    }
}

HSEP_API void hsep_disturbances_restart(hsep_disturbances *self, const double x_d[], const double x_pb[])
{
    const uint64_t first = self->n_ahead - 1;
    for (uint64_t i = 0; i < HSEP_N_DISTURBANCES; i++) {
        hsep_physics_begin(disturbances_filter(self, i), NULL);
        self->filtered[i] = 0.0;
    }
    self->x_d = 2.0 * x_d[first] - x_d[first - 1];
    for (int i = 0; i <= DISTURBANCES_DIFFERENCES; i++) {
        self->x_pb[i] = x_pb[first] - (x_pb[first - 1] - x_pb[first]) * (double)(i + 1);
    }
}

HSEP_API int hsep_disturbances_valid(
    const void *block, const hsep_predictor_settings *settings, uint64_t n_modes, uint64_t late)
{
    hsep_disturbances got;
    memcpy(&got, block, sizeof got);
    (void)disturbances_lay_out(&got, settings, n_modes, late); /* changes nothing where it is sound */
    int sound = memcmp(&got, block, sizeof got) == 0;
    for (uint64_t i = 0; i < HSEP_N_DISTURBANCES + 2; i++) {
        const void *filter = hsep_at_bytes(block, got.filters + i * got.filter_words);
        sound = sound && hsep_physics_valid(filter, n_modes, settings->dead_time);
    }
    return sound;
}

HSEP_API double hsep_disturbances_peak_velocity(const hsep_disturbances *self, const double x_d[])
{
    double largest = 0.0, last = self->x_d;
    for (uint64_t j = self->n_ahead; j-- > 0;) {
        largest = fmax(largest, fabs(x_d[j] - last));
        last = x_d[j];
    }
    return largest / self->T_s;
}

/* Filter a disturbance over one sample, and put the result and its first difference into a row. */
static void disturbances_filter_sample(
    const hsep_disturbances *self, hsep_physics *filter, uint64_t i, double disturbance, double *filtered, double row[])
{
    double *entry = row + 2 + self->n_differences + i;
    hsep_physics_forced_response(filter, &disturbance, entry, 1);
    entry[HSEP_N_DISTURBANCES] = *entry - *filtered;
    *filtered = *entry;
}

/* Put 1, x_pb(k) and its differences into a row. x_pb: the last four, newest first. */
static void disturbances_differences(const hsep_disturbances *self, double row[])
{
    double d[DISTURBANCES_DIFFERENCES + 1];
    memcpy(d, self->x_pb, sizeof d);
    row[0] = 1.0;
    for (uint64_t i = 0; i <= self->n_differences; i++) {
        row[1 + i] = d[0];
        for (uint64_t j = 0; j + i < DISTURBANCES_DIFFERENCES; j++) {
            d[j] -= d[j + 1];
        }
    }
}

/* Put the motion of a sample into its row, m, and its last ones into self. */
static void disturbances_move(hsep_disturbances *self, double x_d, double x_pb, double row[])
{
    self->x_d = x_d;
    for (int i = DISTURBANCES_DIFFERENCES; i > 0; i--) {
        self->x_pb[i] = self->x_pb[i - 1];
    }
    self->x_pb[0] = x_pb;
    disturbances_differences(self, row);
}

/* Friction or damping at a sample, with its commanded and its predicted velocity, m/s. */
static double disturbances_value(uint64_t i, double v_d, double v_pb, double scale)
{
    return i == DISTURBANCES_DAMPING ? v_pb * fabs(v_pb) : tanh(v_d / (scale * disturbances_spread[i]));
}

HSEP_API void hsep_disturbances_begin(
    hsep_disturbances *self, const double x_d[], const double x_pb[], double velocity_scale, double rows[])
{
    const double scale = velocity_scale > 0.0 ? velocity_scale : 1.0;
    const uint64_t n = self->n_ahead, late = n - self->Np;
    const double first_x_d = self->x_d, first_x_pb = self->x_pb[0];
    hsep_disturbances after = *self; /* its scalars, at the end of the window */
    for (uint64_t j = n; j-- > 0;) {
        disturbances_move(self, x_d[j], x_pb[j], rows + (n - 1 - j) * self->n);
        if (j == late) {
            after = *self;
        }
    }
    for (uint64_t i = 0; i < HSEP_N_DISTURBANCES; i++) {
        hsep_physics *filter = disturbances_filter(self, i), *beyond = (hsep_physics *)hsep_at(self, self->beyond);
        double filtered = self->filtered[i], last_x_d = first_x_d, last_x_pb = first_x_pb;
        for (uint64_t j = n; i != DISTURBANCES_STIFFNESS && j-- > 0;) {
            const double v_d = (x_d[j] - last_x_d) / self->T_s, v_pb = (x_pb[j] - last_x_pb) / self->T_s;
            disturbances_filter_sample(
                self, j >= late ? filter : beyond, i, disturbances_value(i, v_d, v_pb, scale), &filtered,
                rows + (n - 1 - j) * self->n);
            last_x_d = x_d[j];
            last_x_pb = x_pb[j];
            if (j == late) {
                memcpy(beyond, filter, (size_t)self->filter_words * sizeof(double));
                after.filtered[i] = filtered;
            }
        }
    }
    *self = after;
}

HSEP_API void hsep_disturbances_stiffness(hsep_disturbances *self, const double x[], double rows[], uint64_t n)
{
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    memcpy(trial, disturbances_filter(self, DISTURBANCES_STIFFNESS), (size_t)self->filter_words * sizeof(double));
    self->tried = self->filtered[DISTURBANCES_STIFFNESS];
    for (uint64_t j = n; j-- > 0; rows += self->n) {
        disturbances_filter_sample(self, trial, DISTURBANCES_STIFFNESS, x[j] * fabs(x[j]), &self->tried, rows);
    }
}

HSEP_API void hsep_disturbances_end(hsep_disturbances *self)
{
    memcpy(
        disturbances_filter(self, DISTURBANCES_STIFFNESS), hsep_at(self, self->trial),
        (size_t)self->filter_words * sizeof(double));
    self->filtered[DISTURBANCES_STIFFNESS] = self->tried;
}

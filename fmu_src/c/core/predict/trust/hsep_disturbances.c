#include "hsep_disturbances.h"

#include "hsep_predict_constants.h"
#include "hsep_trust_constants.h"

#include <math.h>
#include <string.h>

#define DISTURBANCES_TOGETHER 64 /* samples that are filtered in one go */

#define DISTURBANCES_SPREAD_2 (HSEP_TRUST_FRICTION_LEAST * HSEP_TRUST_FRICTION_RATIO * HSEP_TRUST_FRICTION_RATIO)
#define DISTURBANCES_SPREAD_4 (DISTURBANCES_SPREAD_2 * HSEP_TRUST_FRICTION_RATIO * HSEP_TRUST_FRICTION_RATIO)

/* Velocities of the friction's change of sign, relative to the velocity scale. */
static const double disturbances_spread[HSEP_DISTURBANCES_FRICTION] = {
    HSEP_TRUST_FRICTION_LEAST, HSEP_TRUST_FRICTION_LEAST * HSEP_TRUST_FRICTION_RATIO,
    DISTURBANCES_SPREAD_2,     DISTURBANCES_SPREAD_2 * HSEP_TRUST_FRICTION_RATIO,
    DISTURBANCES_SPREAD_4,     DISTURBANCES_SPREAD_4 * HSEP_TRUST_FRICTION_RATIO};

static const double disturbances_turn = 6.283185307179586; /* rad */

HSEP_API uint64_t hsep_disturbances_count(double period)
{
    return period > 0.0 ? HSEP_DISTURBANCES_MAX : HSEP_DISTURBANCES_PERIODIC;
}

HSEP_API uint64_t hsep_disturbances_n(uint64_t q, double period)
{
    return 2 + (q < HSEP_DISTURBANCES_DIFFERENCES ? q : HSEP_DISTURBANCES_DIFFERENCES) +
           2 * hsep_disturbances_count(period);
}

HSEP_API double hsep_disturbances_share(const hsep_disturbances *self, uint64_t feature)
{
    return feature + self->count < self->n ? 1.0 : HSEP_TRUST_DIFFERENCE_SHARE;
}

static hsep_physics *disturbances_filter(hsep_disturbances *self, uint64_t i)
{
    return (hsep_physics *)hsep_at(self, self->filters + i * self->filter_words);
}

static hsep_physics *disturbances_tried(hsep_disturbances *self, uint64_t i)
{
    return (hsep_physics *)hsep_at(self, self->tried + i * self->filter_words);
}

/* Set what follows from the parameters; return the bytes of the block. */
static double disturbances_lay_out(
    hsep_disturbances *self, const hsep_predictor_settings *settings, double period, uint64_t n_modes, int of_motion)
{
    const uint64_t count = hsep_disturbances_count(period);
    const double filters = (double)count * hsep_physics_size(n_modes, settings->dead_time);
    double end = HSEP_WORDS(hsep_disturbances);
    self->count = count;
    self->period = period;
    self->n = hsep_disturbances_n(settings->q, period);
    self->n_differences = self->n - 2 - 2 * count;
    self->of_motion = of_motion != 0;
    self->T_s = settings->T_s;
    self->filters = hsep_take_block(&end, filters);
    self->tried = hsep_take_block(&end, filters);
    self->filter_words = (self->tried - self->filters) / count;
    return end * sizeof(double);
}

HSEP_API double hsep_disturbances_size(const hsep_predictor_settings *settings, double period, uint64_t n_modes)
{
    return disturbances_lay_out(&(hsep_disturbances){0}, settings, period, n_modes, 0);
}

HSEP_API void hsep_disturbances_init(
    hsep_disturbances *self, const hsep_predictor_settings *settings, double period, const hsep_mode modes[],
    uint64_t n_modes, int of_motion, double start)
{
    memset(self, 0, (size_t)hsep_disturbances_size(settings, period, n_modes));
    (void)disturbances_lay_out(self, settings, period, n_modes, of_motion);
    self->origin = start;
    for (uint64_t i = 0; i < 2 * self->count; i++) { /* those that were tried behind them */
        hsep_physics_init(
            disturbances_filter(self, i), modes, n_modes, settings->dead_time, settings->T_s,
            (hsep_hold)settings->input_hold);
    }
}

HSEP_API int hsep_disturbances_valid(
    const void *block, const hsep_predictor_settings *settings, double period, uint64_t n_modes, int of_motion)
{
    hsep_disturbances got;
    memcpy(&got, block, sizeof got);
    (void)disturbances_lay_out(&got, settings, period, n_modes, of_motion); /* changes nothing where it is sound */
    int sound = memcmp(&got, block, sizeof got) == 0;
    for (uint64_t i = 0; i < 2 * got.count; i++) {
        const void *filter = hsep_at_bytes(block, got.filters + i * got.filter_words);
        sound = sound && hsep_physics_valid(filter, n_modes, settings->dead_time);
    }
    return sound;
}

HSEP_API void hsep_disturbances_restart(hsep_disturbances *self, const double x_d[], const double x_pb[], uint64_t n)
{
    hsep_disturbed *before = &self->before;
    for (uint64_t i = 0; i < self->count; i++) {
        hsep_physics_begin(disturbances_filter(self, i), NULL);
        before->filtered[i] = 0.0;
    }
    before->x_d = 2.0 * x_d[n - 1] - x_d[n - 2];
    for (int i = 0; i <= HSEP_DISTURBANCES_DIFFERENCES; i++) {
        before->x_pb[i] = x_pb[n - 1] - (x_pb[n - 2] - x_pb[n - 1]) * (double)(i + 1);
    }
}

HSEP_API double hsep_disturbances_peak_velocity(const hsep_disturbances *self, const double x_d[], uint64_t n)
{
    double largest = 0.0, last = self->before.x_d;
    for (uint64_t j = n; j-- > 0;) {
        largest = fmax(largest, fabs(x_d[j] - last));
        last = x_d[j];
    }
    return largest / self->T_s;
}

/* Filter the disturbances first ... first + count - 1, whose n samples are side by side in u, and put the results and
 * their first differences into the rows. */
static void disturbances_filter_samples(
    hsep_disturbances *self, uint64_t first, uint64_t count, double u[], uint64_t n, double rows[])
{
    double x[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER];
    hsep_physics *filters[HSEP_PHYSICS_ABREAST] = {NULL};
    for (uint64_t i = 0; i < count; i++) {
        filters[i] = disturbances_tried(self, first + i);
    }
    hsep_physics_abreast(filters, count, u, x, n);
    double *entry = rows + 2 + self->n_differences + first, *filtered = self->after.filtered + first;
    for (uint64_t k = 0; k < n; k++, entry += self->n) {
        for (uint64_t i = 0; i < count; i++) {
            const double now = x[HSEP_PHYSICS_ABREAST * k + i];
            entry[i] = now;
            entry[self->count + i] = now - filtered[i];
            filtered[i] = now;
        }
    }
}

/* Begin with the filters first ... last - 1 as they were before the window. */
static void disturbances_rewind(hsep_disturbances *self, uint64_t first, uint64_t last)
{
    memcpy(
        disturbances_tried(self, first), disturbances_filter(self, first),
        (size_t)((last - first) * self->filter_words) * sizeof(double));
    for (uint64_t i = first; i < last; i++) {
        self->after.filtered[i] = self->before.filtered[i];
    }
}

/* Put 1, x_pb(k) and its differences into a row. x_pb: the last four, newest first. */
static void disturbances_differences(const hsep_disturbances *self, const double x_pb[], double row[])
{
    double d[HSEP_DISTURBANCES_DIFFERENCES + 1];
    memcpy(d, x_pb, sizeof d);
    row[0] = 1.0;
    for (uint64_t i = 0; i <= self->n_differences; i++) {
        row[1 + i] = d[0];
        for (uint64_t j = 0; j + i < HSEP_DISTURBANCES_DIFFERENCES; j++) {
            d[j] -= d[j + 1];
        }
    }
}

/* Velocity of the change of sign of friction i, m/s. */
static double disturbances_sign_velocity(double velocity_scale, uint64_t i)
{
    return (velocity_scale > 0.0 ? velocity_scale : 1.0) * disturbances_spread[i];
}

/* Friction of n samples of the velocity v_d, m/s, into the rows. */
static void disturbances_friction(
    hsep_disturbances *self, const double v_d[], uint64_t n, double velocity_scale, double rows[])
{
    double u[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER] = {0.0};
    for (uint64_t first = 0; first < HSEP_DISTURBANCES_FRICTION; first += HSEP_PHYSICS_ABREAST) {
        const uint64_t left = HSEP_DISTURBANCES_FRICTION - first;
        const uint64_t count = left < HSEP_PHYSICS_ABREAST ? left : HSEP_PHYSICS_ABREAST;
        for (uint64_t i = 0; i < count; i++) {
            const double spread = disturbances_sign_velocity(velocity_scale, first + i);
            for (uint64_t k = 0; k < n; k++) {
                u[HSEP_PHYSICS_ABREAST * k + i] = tanh(v_d[k] / spread);
            }
        }
        disturbances_filter_samples(self, first, count, u, n, rows);
    }
}

HSEP_API void hsep_disturbances_command(
    hsep_disturbances *self, const double x_d[], const double x_pb[], uint64_t n, double velocity_scale, double rows[])
{
    hsep_disturbed *now = &self->after;
    double v_d[DISTURBANCES_TOGETHER];
    disturbances_rewind(self, 0, HSEP_DISTURBANCES_FRICTION);
    now->x_d = self->before.x_d;
    memcpy(now->x_pb, self->before.x_pb, sizeof now->x_pb);
    for (uint64_t j = n; j > 0;) {
        const uint64_t count = j < DISTURBANCES_TOGETHER ? j : DISTURBANCES_TOGETHER;
        for (uint64_t k = 0; k < count; k++) {
            j--;
            v_d[k] = (x_d[j] - now->x_d) / self->T_s;
            now->x_d = x_d[j];
            for (int i = HSEP_DISTURBANCES_DIFFERENCES; i > 0; i--) {
                now->x_pb[i] = now->x_pb[i - 1];
            }
            now->x_pb[0] = x_pb[j];
            disturbances_differences(self, now->x_pb, rows + k * self->n);
        }
        disturbances_friction(self, v_d, count, velocity_scale, rows);
        rows += count * self->n;
    }
}

/* Velocity of the damping at place j of n samples, m/s. */
static double disturbances_velocity(
    const hsep_disturbances *self, const double x_pb[], const double x[], uint64_t n, uint64_t j)
{
    const int is_first = j + 1 == n;
    double step = x_pb[j] - (is_first ? self->before.x_pb[0] : x_pb[j + 1]);
    if (self->of_motion && !is_first) { /* the change of what the physics model misses; not known at the first */
        step += (x[j] - x_pb[j]) - (x[j + 1] - x_pb[j + 1]);
    }
    return step / self->T_s;
}

/* Angle within the period at a position relative to the start, rad; 0 without a period. */
static double disturbances_angle(const hsep_disturbances *self, double x)
{
    return self->period > 0.0 ? disturbances_turn / self->period * (self->origin + x) : 0.0;
}

HSEP_API void hsep_disturbances_motion(
    hsep_disturbances *self, const double x_pb[], const double x[], uint64_t n, double rows[])
{
    hsep_disturbances_motion_of(self, x_pb, x, n, 0, n, rows);
}

HSEP_API void hsep_disturbances_motion_of(
    hsep_disturbances *self, const double x_pb[], const double x[], uint64_t n, uint64_t first, uint64_t last,
    double rows[])
{
    const double s = sin(disturbances_angle(self, 0.0)), c = cos(disturbances_angle(self, 0.0));
    double disturbances[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER] = {0.0};
    if (first == 0) {
        disturbances_rewind(self, HSEP_DISTURBANCES_STIFFNESS, self->count);
    }
    rows += first * self->n;
    for (uint64_t j = n - first; j > n - last;) {
        const uint64_t left = j - (n - last), count = left < DISTURBANCES_TOGETHER ? left : DISTURBANCES_TOGETHER;
        for (uint64_t k = 0; k < count; k++) {
            double *of_sample = disturbances + HSEP_PHYSICS_ABREAST * k;
            j--;
            const double v = disturbances_velocity(self, x_pb, x, n, j);
            *of_sample++ = x[j] * fabs(x[j]);
            *of_sample++ = v * fabs(v);
            if (self->count > HSEP_DISTURBANCES_PERIODIC) {
                const double angle = disturbances_angle(self, x[j]);
                *of_sample++ = sin(angle) - s;
                *of_sample = cos(angle) - c;
            }
        }
        disturbances_filter_samples(
            self, HSEP_DISTURBANCES_STIFFNESS, self->count - HSEP_DISTURBANCES_STIFFNESS, disturbances, count, rows);
        rows += count * self->n;
    }
}

HSEP_API void hsep_disturbances_end(hsep_disturbances *self)
{
    memcpy(
        disturbances_filter(self, 0), disturbances_tried(self, 0),
        (size_t)(self->count * self->filter_words) * sizeof(double));
    self->before = self->after;
}

HSEP_API void hsep_disturbances_slopes(
    const hsep_disturbances *self, const double x_d[], const double x_pb[], const double x[], uint64_t n,
    double velocity_scale, double reach, double slopes[])
{
    const double half = reach * velocity_scale;
    double last = self->before.x_d;
    for (uint64_t j = n; j-- > 0; slopes += self->count) {
        const double v_d = (x_d[j] - last) / self->T_s;
        last = x_d[j];
        for (uint64_t i = 0; i < HSEP_DISTURBANCES_FRICTION; i++) {
            const double spread = disturbances_sign_velocity(velocity_scale, i);
            if (half > 0.0) {
                slopes[i] = (tanh((v_d + half) / spread) - tanh((v_d - half) / spread)) / (2.0 * half);
            } else {
                const double sign = tanh(v_d / spread);
                slopes[i] = (1.0 - sign * sign) / spread;
            }
        }
        slopes[HSEP_DISTURBANCES_STIFFNESS] = 2.0 * fabs(x[j]);
        slopes[HSEP_DISTURBANCES_DAMPING] = 2.0 * fabs(disturbances_velocity(self, x_pb, x, n, j));
        if (self->count > HSEP_DISTURBANCES_PERIODIC) {
            const double angle = disturbances_angle(self, x[j]), turns = disturbances_turn / self->period;
            slopes[HSEP_DISTURBANCES_PERIODIC] = turns * cos(angle);
            slopes[HSEP_DISTURBANCES_PERIODIC + 1] = -turns * sin(angle);
        }
    }
}

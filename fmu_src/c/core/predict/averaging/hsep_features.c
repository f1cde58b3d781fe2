#include "hsep_features.h"

#define DISTURBANCES_TOGETHER 64 /* samples that are filtered in one go */

/* Filter i before the window; after all of these are the filters after the samples that were tried. */
static hsep_physics *disturbances_filter(hsep_disturbances *self, hsep_int i)
{
    return hsep_part(self, self->filters + i * self->filter_words);
}

HSEP_API hsep_real hsep_disturbances_lay_out(hsep_disturbances *self, const hsep_predictor_parameters *parameters)
{
    const hsep_int count = hsep_disturbances_count(parameters);
    const hsep_real filter = hsep_physics_lay_out(&(hsep_physics){0}, parameters);
    hsep_real end = HSEP_WORDS(hsep_disturbances);
    self->count = count;
    self->period = parameters->averaging.period;
    self->n = hsep_disturbances_n(parameters);
    self->n_linear = self->n - 2 * count;
    self->of_motion = parameters->compensates != 0;
    self->T_s = parameters->settings.T_s;
    self->filters = hsep_take_block(&end, 2.0 * (hsep_real)count * filter);
    self->filter_words = (hsep_int)(filter / sizeof(hsep_real));
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_disturbances_init(
    hsep_disturbances *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    (void)hsep_disturbances_lay_out(self, parameters);
    self->origin = start;
    for (hsep_int i = 0; i < 2 * self->count; i++) { /* the tried ones, too */
        hsep_physics_init(disturbances_filter(self, i), parameters);
    }
}

HSEP_API void hsep_disturbances_begin_in_motion(
    hsep_disturbances *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_int n, hsep_real velocity_scale)
{
    hsep_disturbed *before = &self->before;
    const hsep_real step = x_d[n - 2] - x_d[n - 1];
    for (hsep_int i = 0; i < HSEP_FEATURES_N_STOPS; i++) {
        const hsep_real distance = hsep_disturbances_spread(velocity_scale, HSEP_FEATURES_N_FRICTION + i);
        before->stops[i] = step > 0.0 ? distance : step < 0.0 ? -distance : 0.0;
    }
    before->x_d = 2.0 * x_d[n - 1] - x_d[n - 2];
    for (int i = 0; i <= HSEP_FEATURES_DIFFERENCES; i++) {
        before->x_pb[i] = x_pb[n - 1] - (x_pb[n - 2] - x_pb[n - 1]) * (hsep_real)(i + 1);
    }
}

HSEP_API hsep_real hsep_disturbances_resolved(const hsep_disturbances *self, hsep_real step)
{
    const hsep_real epsilon = 2.0 / HSEP_EXACT;
    return step > HSEP_FEATURES_RESOLVED * epsilon * hsep_fabs(self->origin) ? step : 0.0;
}

HSEP_API hsep_real hsep_disturbances_peak_velocity(const hsep_disturbances *self, const hsep_real x_d[], hsep_int n)
{
    const hsep_real first = hsep_fabs(x_d[n - 1] - self->before.x_d);
    return hsep_disturbances_resolved(self, hsep_fmax(first, hsep_largest_step(x_d, n))) / self->T_s;
}

/* Filter count disturbances, whose n samples are side by side in u; the rows take the results and differences. */
static void disturbances_filter_samples(
    hsep_disturbances *self, hsep_int first, hsep_int count, hsep_real u[], hsep_int n, hsep_real rows[])
{
    hsep_real x[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER];
    hsep_physics *filters[HSEP_PHYSICS_ABREAST] = {NULL};
    for (hsep_int i = 0; i < count; i++) {
        filters[i] = disturbances_filter(self, self->count + first + i);
    }
    hsep_physics_abreast(filters, count, u, x, n);
    hsep_real *entry = rows + self->n_linear + first, *filtered = self->after.filtered + first;
    for (hsep_int k = 0; k < n; k++, entry += self->n) {
        for (hsep_int i = 0; i < count; i++) {
            const hsep_real now = x[HSEP_PHYSICS_ABREAST * k + i];
            entry[i] = now;
            entry[self->count + i] = now - filtered[i];
            filtered[i] = now;
        }
    }
}

/* Begin with the filters first ... last - 1 as they were before the window. */
static void disturbances_rewind(hsep_disturbances *self, hsep_int first, hsep_int last)
{
    hsep_copy(
        disturbances_filter(self, self->count + first), disturbances_filter(self, first),
        (last - first) * self->filter_words);
    hsep_copy(self->after.filtered + first, self->before.filtered + first, last - first);
}

/* Put 1, x_pb(k) and its differences, and changes of the command, into a row. x_pb: the last four; late: the command
 * that acts, and those before it; newest first. */
static void disturbances_linear(
    const hsep_disturbances *self, const hsep_real x_pb[], const hsep_real late[], hsep_real row[])
{
    const hsep_int n_differences = self->n_linear - HSEP_FEATURES_N_SPANS - 2;
    hsep_real d[HSEP_FEATURES_DIFFERENCES + 1];
    memcpy(d, x_pb, sizeof d);
    row[0] = 1.0;
    for (hsep_int i = 0; i <= n_differences; i++) {
        row[1 + i] = d[0];
        for (hsep_int j = 0; j + i < HSEP_FEATURES_DIFFERENCES; j++) {
            d[j] -= d[j + 1];
        }
    }
    row += self->n_linear - HSEP_FEATURES_N_SPANS;
    for (hsep_int begin = 0, end = HSEP_FEATURES_SPAN, i = 0; i < HSEP_FEATURES_N_SPANS; i++) {
        row[i] = late[begin] - late[end];
        begin = end;
        end *= HSEP_FEATURES_SPAN;
    }
}

HSEP_API hsep_real hsep_disturbances_spread(hsep_real velocity_scale, hsep_int i)
{
    const int is_stop = i >= HSEP_FEATURES_N_FRICTION;
    const hsep_real ratio = is_stop ? HSEP_AVERAGING_STOP_RATIO : HSEP_AVERAGING_FRICTION_RATIO;
    hsep_real found = is_stop ? HSEP_AVERAGING_STOP_LEAST : HSEP_AVERAGING_FRICTION_LEAST;
    for (hsep_int first = is_stop ? HSEP_FEATURES_N_FRICTION : 0; i > first; i--) {
        found *= ratio;
    }
    return (velocity_scale > 0.0 ? velocity_scale : 1.0) * found;
}

/* Friction or stop operator i of n samples, side by side with others. */
static void disturbances_one(
    hsep_disturbances *self, hsep_int i, const hsep_real steps[], hsep_int n, hsep_real velocity_scale, hsep_real u[])
{
    const hsep_real spread = hsep_disturbances_spread(velocity_scale, i);
    if (i < HSEP_FEATURES_N_FRICTION) {
        for (hsep_int k = 0; k < n; k++) {
            u[HSEP_PHYSICS_ABREAST * k] = hsep_tanh(steps[k] / self->T_s / spread);
        }
        return;
    }
    hsep_real *stop = &self->after.stops[i - HSEP_FEATURES_N_FRICTION];
    for (hsep_int k = 0; k < n; k++) {
        *stop = hsep_clip(*stop + steps[k], spread);
        u[HSEP_PHYSICS_ABREAST * k] = *stop / spread;
    }
}

/* Friction and stop operators of n samples of the command's steps, m, into the rows. */
static void disturbances_of_command(
    hsep_disturbances *self, const hsep_real steps[], hsep_int n, hsep_real velocity_scale, hsep_real rows[])
{
    hsep_real u[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER];
    hsep_zero(u, HSEP_PHYSICS_ABREAST * n); /* places without a disturbance are filtered, too */
    for (hsep_int first = 0; first < HSEP_DISTURBANCES_OF_COMMAND; first += HSEP_PHYSICS_ABREAST) {
        const hsep_int count = hsep_min(HSEP_DISTURBANCES_OF_COMMAND - first, HSEP_PHYSICS_ABREAST);
        for (hsep_int i = 0; i < count; i++) {
            disturbances_one(self, first + i, steps, n, velocity_scale, u + i);
        }
        disturbances_filter_samples(self, first, count, u, n, rows);
    }
}

HSEP_API void hsep_disturbances_command(
    hsep_disturbances *self, const hsep_real x_d[], const hsep_real late[], const hsep_real x_pb[], hsep_int n,
    hsep_real velocity_scale, hsep_real rows[])
{
    hsep_disturbed *now = &self->after;
    hsep_real steps[DISTURBANCES_TOGETHER];
    disturbances_rewind(self, 0, HSEP_DISTURBANCES_OF_COMMAND);
    memcpy(now->stops, self->before.stops, sizeof now->stops);
    now->x_d = self->before.x_d;
    memcpy(now->x_pb, self->before.x_pb, sizeof now->x_pb);
    for (hsep_int j = n; j > 0;) {
        const hsep_int count = hsep_min(j, DISTURBANCES_TOGETHER);
        for (hsep_int k = 0; k < count; k++) {
            j--;
            steps[k] = x_d[j] - now->x_d;
            now->x_d = x_d[j];
            hsep_copy(now->x_pb + 1, now->x_pb, HSEP_FEATURES_DIFFERENCES);
            now->x_pb[0] = x_pb[j];
            disturbances_linear(self, now->x_pb, late + j, rows + k * self->n);
        }
        disturbances_of_command(self, steps, count, velocity_scale, rows);
        rows += count * self->n;
    }
}

HSEP_API hsep_real hsep_disturbances_damped_velocity(
    const hsep_disturbances *self, const hsep_real x_pb[], const hsep_real x[], hsep_int n, hsep_int j)
{
    const int is_first = j + 1 == n;
    hsep_real step = x_pb[j] - (is_first ? self->before.x_pb[0] : x_pb[j + 1]);
    if (self->of_motion && !is_first) { /* the change of what the physics model misses; not known at the first */
        step += (x[j] - x_pb[j]) - (x[j + 1] - x_pb[j + 1]);
    }
    return step / self->T_s;
}

HSEP_API hsep_real hsep_disturbances_turned(const hsep_disturbances *self, const hsep_real row[])
{
    const hsep_real turned = -row[self->n_linear] * self->before.filtered[HSEP_FEATURES_N_FRICTION];
    return hsep_fmin(hsep_fmax(turned, 0.0), 1.0);
}

HSEP_API void hsep_disturbances_motion(
    hsep_disturbances *self, const hsep_real x_pb[], const hsep_real x[], hsep_int n, hsep_int first, hsep_int last,
    hsep_real rows[])
{
    const hsep_real s = hsep_sin(hsep_disturbances_angle(self, 0.0)), c = hsep_cos(hsep_disturbances_angle(self, 0.0));
    hsep_real disturbances[HSEP_PHYSICS_ABREAST * DISTURBANCES_TOGETHER];
    const hsep_int most = hsep_min(last - first, DISTURBANCES_TOGETHER);
    hsep_zero(disturbances, HSEP_PHYSICS_ABREAST * most); /* as with friction */
    if (first == 0) {
        disturbances_rewind(self, HSEP_DISTURBANCES_STIFFNESS, self->count);
    }
    rows += first * self->n;
    for (hsep_int j = n - first; j > n - last;) {
        const hsep_int count = hsep_min(j - (n - last), DISTURBANCES_TOGETHER);
        for (hsep_int k = 0; k < count; k++) {
            hsep_real *of_sample = disturbances + HSEP_PHYSICS_ABREAST * k;
            j--;
            const hsep_real v = hsep_disturbances_damped_velocity(self, x_pb, x, n, j);
            *of_sample++ = x[j] * hsep_fabs(x[j]);
            *of_sample++ = v * hsep_fabs(v);
            if (self->count > HSEP_FEATURES_N_LASTING) {
                const hsep_real angle = hsep_disturbances_angle(self, x[j]);
                *of_sample++ = hsep_sin(angle) - s;
                *of_sample = hsep_cos(angle) - c;
            }
        }
        disturbances_filter_samples(
            self, HSEP_DISTURBANCES_STIFFNESS, self->count - HSEP_DISTURBANCES_STIFFNESS, disturbances, count, rows);
        rows += count * self->n;
    }
}

HSEP_API void hsep_disturbances_end(hsep_disturbances *self)
{
    hsep_copy(disturbances_filter(self, 0), disturbances_filter(self, self->count), self->count * self->filter_words);
    self->before = self->after;
}

HSEP_API hsep_real hsep_command_lay_out(hsep_command *self, const hsep_predictor_parameters *parameters)
{
    const hsep_int n = hsep_predicted(parameters), late = parameters->settings.dead_time, half = late / 2;
    hsep_real end = HSEP_WORDS(hsep_command);
    self->n = n;
    const hsep_int margin = half > HSEP_AVERAGING_DEAD_TIME_MARGIN ? half : HSEP_AVERAGING_DEAD_TIME_MARGIN;
    self->dead_time = late > margin ? late - margin : 0;
    self->n_before = self->dead_time + HSEP_AVERAGING_LAGS_OF_COMMAND + 1;
    self->commands = hsep_take(&end, (hsep_real)n + (hsep_real)self->n_before);
    self->rows = hsep_take(&end, (hsep_real)n * HSEP_COMMAND_FEATURES);
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_command_fill(hsep_command *self, hsep_int m, hsep_int first, hsep_int last)
{
    const hsep_real *commands = hsep_at(self, self->commands) + (self->n - m);
    hsep_real *row = hsep_at(self, self->rows) + first * HSEP_COMMAND_FEATURES;
    for (hsep_int k = first; k < last; k++, row += HSEP_COMMAND_FEATURES) {
        const hsep_real *late = commands + (m - 1 - k) + self->dead_time;
        row[0] = 1.0;
        for (hsep_int i = 1; i < HSEP_COMMAND_FEATURES; i++) {
            row[i] = late[i - 1] - late[i];
        }
    }
}

HSEP_API void hsep_command_end(hsep_command *self, hsep_int m)
{
    hsep_real *before = hsep_at(self, self->commands) + self->n;
    hsep_copy(before, before - m, self->n_before);
}

HSEP_API void hsep_command_begin_in_motion(hsep_command *self, hsep_real first, hsep_real second)
{
    hsep_real *before = hsep_at(self, self->commands) + self->n;
    for (hsep_int i = 0; i < self->n_before; i++) {
        before[i] = first - (second - first) * (hsep_real)(i + 1);
    }
}

#include "hsep_plant.h"

static const double plant_internal_step = 1e-4;       /* s */
static const double plant_steps_per_time = 16.0;      /* internal steps in the fastest time constant */
static const double plant_steps_max = 1e6;            /* internal steps of one step */
static const double plant_state_max = 1e100;          /* of a drive's state: outputs and their squares stay finite */
static const double plant_tolerance = 1e-6;           /* of an internal step */
static const int plant_friction_steps = 60;           /* of Newton's method for the velocity under friction, most */
static const double plant_friction_tolerance = 1e-15; /* of such a step, relative */

/* Number of internal steps for a step of h seconds: the fewest that are at most 0.1 ms and 1/(16 rate) long. */
static double plant_internal_steps(double h, double rate)
{
    return fmax(1.0, ceil(fmax(h / plant_internal_step, h * rate * plant_steps_per_time) - plant_tolerance));
}

HSEP_API double hsep_plant_step_max(double rate)
{
    return fmin(plant_steps_max * plant_internal_step, plant_steps_max / plant_steps_per_time / rate);
}

HSEP_API double hsep_plant_mode_rate(const hsep_mode *mode)
{
    const double omega = HSEP_TWO_PI * mode->f_n;
    return fmax(sqrt(omega * omega), 2.0 * mode->zeta * omega);
}

HSEP_API double hsep_feed_drive_rate(const hsep_feed_drive *self)
{
    return fmax(sqrt(self->k / self->m), self->c / self->m);
}

HSEP_API double hsep_feed_drive_x(const hsep_feed_drive *self) { return self->start + self->x; }

HSEP_API double hsep_feed_drive_v(const hsep_feed_drive *self) { return self->u + self->c / self->m * self->x_d; }

/* The slopes p = x' and q = u' of eq. (13) under the command r. */
static void plant_slope(const hsep_feed_drive *d, double x, double u, double r, double *p, double *q)
{
    const double a = d->c / d->m, w2 = d->k / d->m, c_m = d->c_nl / d->m, k_m = d->k_nl / d->m;
    const double v = u + a * r;
    *p = v;
    /* Eq. (13): u' = -(c/m) v - (k/m)(x - x_d) - H_NL/m */
    *q = -a * v - w2 * (x - r) - c_m * v * fabs(v) - k_m * x * fabs(x);
}

HSEP_API int hsep_feed_drive_step(hsep_feed_drive *self, double x_d, double h, double *reached)
{
    const double n = plant_internal_steps(h, hsep_feed_drive_rate(self)), dt = h / n, r = x_d - self->start;
    double x = self->x, u = self->u;
    for (double i = 0.0; i < n; i += 1.0) {
        double p1, p2, p3, p4, q1, q2, q3, q4;
        plant_slope(self, x, u, r, &p1, &q1);
        plant_slope(self, x + dt / 2.0 * p1, u + dt / 2.0 * q1, r, &p2, &q2);
        plant_slope(self, x + dt / 2.0 * p2, u + dt / 2.0 * q2, r, &p3, &q3);
        plant_slope(self, x + dt * p3, u + dt * q3, r, &p4, &q4);
        x += dt / 6.0 * (p1 + 2.0 * p2 + 2.0 * p3 + p4);
        u += dt / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4);
    }
    *reached = x;
    if (!(fabs(x) < plant_state_max && fabs(u) < plant_state_max)) { /* NaN too */
        return 0;
    }
    self->x = x;
    self->u = u;
    self->x_d = r;
    return 1;
}

HSEP_API double hsep_stage_lay_out(hsep_stage *self, uint64_t n_modes, const hsep_stage_settings *settings)
{
    double end = HSEP_WORDS(hsep_stage);
    self->settings = *settings;
    self->n_modes = n_modes;
    self->n_line = settings->dead_time;
    if (settings->input_hold == HSEP_FIRST_ORDER_HOLD && settings->dead_time > 0) {
        self->n_line -= 1; /* from the last command to this one takes a sample */
    }
    self->modes = hsep_take(&end, (double)n_modes * HSEP_WORDS(hsep_stage_mode));
    self->z = hsep_take(&end, 2.0 * (double)n_modes);
    self->line = hsep_take(&end, (double)self->n_line);
    (void)hsep_take(&end, 8.0 * (double)n_modes); /* work space */
    return end * sizeof(double);
}

static const hsep_stage_mode *stage_modes(const hsep_stage *self) { return hsep_part_const(self, self->modes); }

HSEP_API void hsep_stage_init(
    hsep_stage *self, const hsep_mode modes[], uint64_t n_modes, const hsep_stage_settings *settings, double T_s,
    double start)
{
    memset(self, 0, (size_t)hsep_stage_lay_out(self, n_modes, settings));
    (void)hsep_stage_lay_out(self, n_modes, settings);
    (void)hsep_clock_init(&self->clock, 0.0, T_s);
    self->start = start;
    hsep_stage_mode *stage = hsep_part(self, self->modes);
    for (uint64_t i = 0; i < n_modes; i++) {
        const double omega = HSEP_TWO_PI * modes[i].f_n;
        stage[i].omega2 = omega * omega;
        stage[i].two_zeta_omega = 2.0 * modes[i].zeta * omega;
        stage[i].alpha = modes[i].alpha;
        stage[i].beta = modes[i].beta;
        self->friction_gain += modes[i].beta;
    }
    self->friction_gain *= settings->f;
}

/* sum alpha z + beta z' over the modes, z: (2 n_modes,). */
static double plant_position(const hsep_stage *s, const double z[])
{
    const hsep_stage_mode *mode = stage_modes(s);
    double x = 0.0;
    for (uint64_t i = 0; i < s->n_modes; i++) {
        x += mode[i].alpha * z[2 * i] + mode[i].beta * z[2 * i + 1];
    }
    return x;
}

/* The solution of v = w - gain tanh(v / scale), m/s: w is the velocity without friction, gain the velocity that the
 * whole friction takes away at once. For gain < -scale there are two stable solutions: the one in the direction of
 * last, the velocity before, holds until it ends (hysteresis). At most 60 Newton steps, usually 4 to 8. */
static double plant_friction_velocity(double w, double gain, double scale, double last)
{
    if (w == 0.0 && last == 0.0) {
        return 0.0;
    }
    double sign = copysign(1.0, w);
    if (gain < -scale) {
        /* v + gain tanh(v / scale) falls between +-turn: a solution of the other sign than w may be there */
        const double ratio = -gain / scale, turn = scale * log(sqrt(ratio) + sqrt(ratio - 1.0));
        if (last * w < 0.0 && fabs(w) <= -turn - gain * tanh(turn / scale)) {
            sign = -sign;
        }
    }
    w *= sign;
    /* Newton from the side where its steps are monotone: v + gain tanh(v / scale) is concave or convex for v > 0. */
    double v = gain > 0.0 ? fmax(w - gain, w / (1.0 + gain / scale)) : w - gain;
    for (int i = 0; i < plant_friction_steps; i++) {
        const double t = tanh(v / scale), slope = 1.0 + gain / scale * (1.0 - t * t);
        if (!(slope > 0.0)) {
            break;
        }
        const double step = (v + gain * t - w) / slope;
        v -= step;
        if (fabs(step) <= plant_friction_tolerance * fabs(v)) {
            break;
        }
    }
    return sign * v;
}

/* The slope of z, (2 n_modes,), under a command disturbed by its friction; v, m/s, is a velocity shortly before. */
static void plant_stage_slope(const hsep_stage *s, const double z[], double disturbed, double v, double slope[])
{
    const hsep_stage_mode *mode = stage_modes(s);
    const double x = plant_position(s, z);
    const double u = disturbed - s->settings.kappa * x * fabs(x);
    for (uint64_t i = 0; i < s->n_modes; i++) {
        /* z'' + 2 zeta omega z' + omega^2 z = u, eq. (15) */
        slope[2 * i] = z[2 * i + 1];
        slope[2 * i + 1] = u - mode[i].two_zeta_omega * z[2 * i + 1] - mode[i].omega2 * z[2 * i];
    }
    if (s->settings.friction_on == HSEP_FRICTION_MOTION) {
        v = plant_friction_velocity(plant_position(s, slope), s->friction_gain, s->settings.v_friction, v);
        const double friction = s->settings.f * tanh(v / s->settings.v_friction);
        for (uint64_t i = 0; i < s->n_modes; i++) {
            slope[2 * i + 1] -= friction;
        }
    }
}

/* The command after the carriage's friction, d = f tanh(v_d / v_friction), if it follows the commanded velocity. */
static double plant_disturbed(const hsep_stage *s, double r, double v_d)
{
    const hsep_stage_settings *of = &s->settings;
    return of->friction_on == HSEP_FRICTION_COMMAND ? r - of->f * tanh(v_d / of->v_friction) : r;
}

/* One Runge-Kutta step of z, (size,), followed by three more vectors of work space, under a command that goes on by
 * rate, m/s. *v, m/s: a velocity shortly before; that at its beginning. */
static void plant_stage_internal_step(
    const hsep_stage *s, double z[], double disturbed, double rate, double dt, double *v)
{
    static const double weight[4] = {1.0, 2.0, 2.0, 1.0};
    const double reach[4] = {dt / 2.0, dt / 2.0, dt, 0.0}; /* from z to where the next slope is taken */
    const double time[4] = {0.0, dt / 2.0, dt / 2.0, dt};
    const uint64_t size = 2 * s->n_modes;
    double *slope = z + size, *at = slope + size, *sum = at + size;
    for (uint64_t i = 0; i < size; i++) {
        at[i] = z[i];
        sum[i] = 0.0;
    }
    for (int stage = 0; stage < 4; stage++) {
        plant_stage_slope(s, at, disturbed + rate * time[stage], *v, slope);
        if (stage == 0) {
            *v = plant_position(s, slope);
        }
        for (uint64_t i = 0; i < size; i++) {
            sum[i] += weight[stage] * slope[i];
            at[i] = z[i] + reach[stage] * slope[i];
        }
    }
    for (uint64_t i = 0; i < size; i++) {
        z[i] += dt / 6.0 * sum[i];
    }
}

HSEP_API double hsep_stage_rate(const hsep_stage *self)
{
    const hsep_stage_mode *mode = stage_modes(self);
    double rate = 0.0;
    for (uint64_t i = 0; i < self->n_modes; i++) {
        rate = fmax(rate, fmax(sqrt(mode[i].omega2), mode[i].two_zeta_omega));
    }
    return rate;
}

HSEP_API int hsep_stage_step(hsep_stage *self, double x_d, double h)
{
    const double r = x_d - self->start;
    const int foh = self->settings.input_hold == HSEP_FIRST_ORDER_HOLD, late = self->settings.dead_time > 0;
    double acting = foh || late ? self->acting : r;
    double last_x_d = self->last_x_d, v_d = self->v_d, v = self->v, done = 0.0;
    const size_t z_size = (size_t)(2 * self->n_modes) * sizeof(double);
    double *line = hsep_at(self, self->line), *z = line + self->n_line; /* work space, zeros between steps */
    double *slope = z + 2 * self->n_modes;
    hsep_clock_step step;
    (void)hsep_clock_count(&self->clock, self->clock.end, h, &step);
    memcpy(z, hsep_at(self, self->z), z_size);
    /* The command is sampled, and v_d updated, at the sampling instants, whatever the step size. */
    for (int64_t i = 0; i <= step.n_latched; i++) {
        const double next = i < step.n_latched ? fmax(done, step.first + (double)i * self->clock.T_s) : h;
        if (next > done) {
            const double time = next - done, rate = foh ? v_d : 0.0; /* m/s, with which the command goes on */
            const double n = plant_internal_steps(time, hsep_stage_rate(self)), dt = time / n;
            const double disturbed = plant_disturbed(self, acting, v_d);
            for (double j = 0.0; j < n; j += 1.0) {
                plant_stage_internal_step(self, z, disturbed + rate * (j * dt), rate, dt, &v);
            }
            acting += rate * time;
            done = next;
        }
        if (i < step.n_latched) {
            const uint64_t in_line = (uint64_t)i;
            const double left = in_line < self->n_line ? line[(self->oldest + in_line) % self->n_line] : r;
            v_d = (left - last_x_d) / self->clock.T_s;
            acting = foh && late ? last_x_d : left;
            last_x_d = left;
        }
    }
    const int finite = hsep_within(z, 2 * self->n_modes, plant_state_max);
    if (finite) {
        plant_stage_slope(self, z, plant_disturbed(self, acting, v_d), v, slope);
        self->v = plant_position(self, slope);
        memcpy(hsep_at(self, self->z), z, z_size);
        for (uint64_t i = 0; i < (uint64_t)step.n_latched && i < self->n_line; i++) {
            line[self->oldest] = r;
            self->oldest = (self->oldest + 1) % self->n_line;
        }
        self->acting = acting;
        self->last_x_d = last_x_d;
        self->v_d = v_d;
        self->clock = step.after;
    }
    memset(z, 0, 4 * z_size);
    return finite;
}

HSEP_API double hsep_stage_v(const hsep_stage *self) { return self->v; }

HSEP_API double hsep_stage_x(const hsep_stage *self)
{
    return self->start + plant_position(self, hsep_at_const(self, self->z));
}

/* The index-th number of the SplitMix64 sequence of a seed. */
static uint64_t encoder_split_mix_64(uint64_t seed, uint64_t index)
{
    uint64_t z = seed + (index + 1) * UINT64_C(0x9E3779B97F4A7C15);
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

HSEP_API double hsep_encoder_measure(hsep_encoder *self, double x)
{
    const uint64_t first = 2 * self->n_draws;
    self->n_draws++;
    /* Uniform in (0, 1] and [0, 1), 53 bits each */
    const double u1 = ldexp((double)((encoder_split_mix_64(self->seed, first) >> 11) + 1), -53);
    const double u2 = ldexp((double)(encoder_split_mix_64(self->seed, first + 1) >> 11), -53);
    return x + self->noise_std * sqrt(-2.0 * log(u1)) * cos(HSEP_TWO_PI * u2);
}

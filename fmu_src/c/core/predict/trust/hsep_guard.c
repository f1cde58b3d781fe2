#include "hsep_guard.h"

#include "hsep_median.h"
#include "hsep_trust_constants.h"

#include <math.h>

#define GUARD_WINDOW (2 * HSEP_GUARD_NEIGHBOURS + 1)

static const uint64_t guard_doubted = 3;             /* doubtful samples in a row from which on they may be true */
static const double guard_most = 9007199254740992.0; /* counts that doubles hold exactly */
static const double guard_windows = 2.0; /* least patience, in windows: what is believed is learned by windows */
/* Changes that a window has to have to tell the vibration: most of fewer could be those of one wrong value. */
static const uint64_t guard_changes = 8;

/* Samples of a time, s; two windows at least. */
static uint64_t guard_patience(double time, uint64_t Np, double T_s)
{
    return (uint64_t)fmin(fmax(guard_windows * (double)Np, ceil(time / T_s)), guard_most);
}

HSEP_API void hsep_guard_init(hsep_guard *self, uint64_t Np, double T_s)
{
    *self = (hsep_guard){
        .patience = guard_patience(HSEP_TRUST_PATIENCE, Np, T_s),
        .patience_standing = guard_patience(HSEP_TRUST_PATIENCE_STANDING, Np, T_s),
        .spread = -1.0,
        .last_x_pb = NAN};
    hsep_held_init(&self->held);
}

/* Residual i of the window, or one before it; NaN behind it. */
static double guard_residual(const hsep_guard *self, const double x[], const double x_pb[], uint64_t n, int64_t i)
{
    if (i < 0) {
        return self->before[HSEP_GUARD_NEIGHBOURS + i];
    }
    return (uint64_t)i < n ? x[n - 1 - (uint64_t)i] - x_pb[n - 1 - (uint64_t)i] : NAN;
}

/* Deviation of residual i from the median of its neighbours and itself, as far as they are known. */
static double guard_deviation(const hsep_guard *self, const double x[], const double x_pb[], uint64_t n, uint64_t i)
{
    const double residual = guard_residual(self, x, x_pb, n, (int64_t)i);
    double ordered[GUARD_WINDOW];
    int count = 0;
    if (!isfinite(residual)) {
        return 0.0;
    }
    for (int64_t j = -HSEP_GUARD_NEIGHBOURS; j <= HSEP_GUARD_NEIGHBOURS; j++) {
        const double other = guard_residual(self, x, x_pb, n, (int64_t)i + j);
        if (isfinite(other)) {
            int place = count++;
            for (; place > 0 && ordered[place - 1] > other; place--) {
                ordered[place] = ordered[place - 1];
            }
            ordered[place] = other;
        }
    }
    return fabs(residual - 0.5 * (ordered[(count - 1) / 2] + ordered[count / 2]));
}

/* Let the mean deviation follow that of the measured samples; one beyond what is plausible counts as that. */
static void guard_follow(
    hsep_guard *self, const double x[], const double deviation[], uint64_t n, int known, double plausible)
{
    double sum = 0.0, count = 0.0;
    for (uint64_t k = 0; k < n; k++) {
        if (isfinite(x[k])) {
            sum += known ? fmin(deviation[k], plausible) : deviation[k];
            count += 1.0;
        }
    }
    if (count > 0.0) {
        const double mean = sum / count, rate = mean > self->spread ? HSEP_TRUST_RISE : HSEP_TRUST_FALL;
        self->spread = known ? self->spread + rate * (mean - self->spread) : mean;
    }
}

/* Let the vibration follow the median change of the residual, which no minority of wrong values moves. */
static void guard_follow_vibration(
    hsep_guard *self, const double x[], const double x_pb[], double changes[], uint64_t n)
{
    double last = self->before[HSEP_GUARD_NEIGHBOURS - 1];
    uint64_t count = 0;
    for (uint64_t k = 0; k < n; k++) {
        const double residual = guard_residual(self, x, x_pb, n, (int64_t)k), change = fabs(residual - last);
        if (isfinite(change)) {
            changes[count++] = change;
        }
        last = residual;
    }
    if (count >= guard_changes) {
        const double seen = fmax(hsep_median(changes, count) - HSEP_TRUST_VIBRATION_NOISE * self->spread, 0.0);
        self->vibration += (seen > self->vibration ? 1.0 : HSEP_TRUST_FALL) * (seen - self->vibration);
    }
}

/* Plausible deviation, m, under a predicted motion of a sample, m. */
static double guard_plausible(const hsep_guard *self, double motion, double largest)
{
    const double step = self->held.step < HUGE_VAL ? self->held.step : 0.0;
    return HSEP_TRUST_SPREADS * self->spread + HSEP_TRUST_RESOLUTION * step + HSEP_TRUST_SMALL * largest +
           HSEP_TRUST_RIPPLE * motion;
}

/* Tell, where a run of equal values ends, an axis that stood from a sensor that was held; residual: m, of the value. */
static void guard_tell_rest(hsep_guard *self, double x, double residual, double plausible)
{
    const double motion = self->held.high - self->held.low;
    if (hsep_held_stays(&self->held, motion, plausible, fabs(x - self->held.value))) {
        if (fabs(residual - self->measured) <= fabs(residual - self->before_run)) {
            self->stood = fmax(self->stood, motion);
        } else if (motion <= HSEP_TRUST_STOOD_MORE * self->stood) { /* without that bound: the belief was wrong */
            self->stood = 0.0;
        }
    }
    self->before_run = self->measured;
}

/* Set the run of equal values that ends with sample k to a value. */
static void guard_set_run(const hsep_guard *self, uint64_t k, uint64_t n, double value, double of_samples[])
{
    const uint64_t repeats = (uint64_t)fmin(self->held.repeats, (double)(k + 1));
    for (uint64_t j = k + 1 - repeats; j <= k; j++) {
        of_samples[n - 1 - j] = value;
    }
}

HSEP_API void hsep_guard_accept(
    hsep_guard *self, const double x[], const double x_pb[], uint64_t n, double largest, double deviation[],
    double accepted[], double suspect[])
{
    double pace = 0.0, last = isnan(self->last_x_pb) ? x_pb[n - 1] : self->last_x_pb;
    for (uint64_t k = 0; k < n; k++) {
        pace = fmax(pace, fabs(x_pb[n - 1 - k] - last));
        last = x_pb[n - 1 - k];
        deviation[n - 1 - k] = guard_deviation(self, x, x_pb, n, k);
    }
    const double motion = fmax(fmax(pace, self->pace), self->vibration);
    const double plausible = guard_plausible(self, motion, largest);
    const int known = self->spread >= 0.0;
    for (uint64_t k = 0; k < n; k++) {
        const uint64_t place = n - 1 - k;
        const double residual = x[place] - x_pb[place];
        self->gap++;
        accepted[place] = suspect[place] = 0.0;
        if (!isfinite(x[place])) {
            continue;
        }
        if (x[place] != self->held.value) {
            guard_tell_rest(self, x[place], residual, plausible);
        }
        self->measured = residual;
        const double standing = fmin(HSEP_TRUST_STOOD_MORE * self->stood, HSEP_TRUST_STOOD_RESIDUAL * largest);
        self->holding = (uint64_t)hsep_held_holds(&self->held, x[place], x_pb[place], fmax(plausible, standing));
        if (self->holding) {
            guard_set_run(self, k, n, 1.0, suspect);
        }
        if (self->holding && ++self->doubtful > self->patience_standing) { /* the axis itself stands still */
            accepted[place] = 1.0;
            self->last = residual;
            self->gap = 0;
            continue;
        }
        if (self->holding) {
            guard_set_run(self, k, n, 0.0, accepted);
            continue;
        }
        if (known) {
            /* Towards the prediction is no jump. */
            const double nearest = fmin(fmax(residual, fmin(self->last, 0.0)), fmax(self->last, 0.0));
            const int jumping = fabs(residual - nearest) > plausible + (double)self->gap * HSEP_TRUST_PACE * motion;
            self->doubtful = jumping ? self->doubtful + 1 : 0;
            if ((jumping && self->doubtful <= self->patience) || deviation[place] > plausible) {
                continue;
            }
        }
        accepted[place] = 1.0;
        self->last = residual;
        self->gap = self->doubtful = 0;
    }
    guard_follow(self, x, deviation, n, known, plausible);
    guard_follow_vibration(self, x, x_pb, deviation, n);
    for (uint64_t j = 0; j < HSEP_GUARD_NEIGHBOURS; j++) {
        self->before[j] = guard_residual(self, x, x_pb, n, (int64_t)n - HSEP_GUARD_NEIGHBOURS + (int64_t)j);
    }
    self->pace = pace;
    self->last_x_pb = last;
}

HSEP_API hsep_doubt hsep_guard_doubt(const hsep_guard *self, double largest)
{
    const double last = self->before[HSEP_GUARD_NEIGHBOURS - 1];
    const double range = self->held.high - self->held.low;
    const double motion = fmin(range, self->pace * fmin(self->held.repeats, (double)self->patience));
    const double plausible = guard_plausible(self, fmax(self->pace, self->vibration), largest);
    if (self->holding || hsep_held_stays(&self->held, motion, plausible, HUGE_VAL)) {
        return (hsep_doubt){isfinite(self->held.value) ? HSEP_STANDS : HSEP_NO_DOUBT, self->held.value};
    }
    if (self->doubtful >= guard_doubted && self->doubtful <= self->patience && isfinite(last)) {
        return (hsep_doubt){HSEP_OTHER_LEVEL, last};
    }
    return (hsep_doubt){HSEP_NO_DOUBT, 0.0};
}

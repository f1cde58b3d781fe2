#include "hsep_clock.h"

#include <math.h>

static const double clock_tolerance = 1e-6;    /* of T_s */
static const double clock_spacings = 8.0;      /* of doubles at t: a few roundings of the importer's arithmetic */
static const double clock_split = 134217729.0; /* 2^27 + 1, splits a double into two halves (Veltkamp 1968) */
static const double clock_samples_max = 9007199254740992.0; /* 2^53: counted exactly in a double */

static double clock_resolution(double t) { return clock_spacings * (nextafter(fabs(t), HUGE_VAL) - fabs(t)); }

/* delta at t, s; T_s / 4 at times so large that doubles no longer resolve it. */
static double clock_delta(const hsep_clock *self, double t)
{
    return fmin(fmax(clock_tolerance * self->T_s, clock_resolution(t)), 0.25 * self->T_s);
}

/* Compensated sum since + carry + time: Knuth's two-sum, then renormalised. */
static void clock_add(hsep_clock *self, double time)
{
    const double sum = self->since + time, part = sum - self->since;
    const double lost = (self->since - (sum - part)) + (time - part) + self->carry;
    self->since = sum + lost;
    self->carry = lost - (self->since - sum);
}

/* Take n instants from since: n T_s in two products that are exact for n below 2^27. */
static void clock_take(hsep_clock *self, double n)
{
    const double scaled = clock_split * self->T_s, high = scaled - (scaled - self->T_s);
    clock_add(self, -n * high);
    clock_add(self, -n * (self->T_s - high));
    self->k += (int64_t)n;
}

HSEP_API int hsep_clock_init(hsep_clock *self, double start, double T_s)
{
    *self = (hsep_clock){.start = start, .T_s = T_s, .end = start};
    return clock_resolution(start) <= 0.25 * T_s;
}

HSEP_API int hsep_clock_count(const hsep_clock *self, double t, double h, hsep_clock_step *step)
{
    *step = (hsep_clock_step){.after = *self};
    if (!(fabs(t - self->end) <= fmax(0.5 * self->T_s, clock_resolution(t)))) {
        return 0;
    }
    hsep_clock *after = &step->after;
    clock_add(after, h);
    after->end = t + h;
    const double now = self->start + ((double)self->k * self->T_s + after->since);
    const double delta = clock_delta(self, now);
    clock_take(after, floor((after->since + delta) / self->T_s));
    if (after->since < -delta) { /* the quotient was rounded up to the next instant */
        clock_take(after, -1.0);
    }
    after->latched = after->since > delta; /* an instant within delta of the end belongs to the next step */
    step->n_samples = after->k - self->k;
    step->n_latched = step->n_samples + after->latched - self->latched;
    step->first = (self->latched ? self->T_s : 0.0) - self->since;
    step->inside = step->n_latched > 1 - self->latched; /* t_k, where it is not read yet, is the step's start */
    return 1;
}

HSEP_API int hsep_clock_valid(const hsep_clock *self)
{
    return isfinite(self->start) && self->T_s > 0.0 && isfinite(self->T_s) && self->k >= 0 &&
           (double)self->k < clock_samples_max && fabs(self->since) <= self->T_s &&
           fabs(self->carry) <= fabs(self->since) && isfinite(self->end) && (self->latched == 0 || self->latched == 1);
}

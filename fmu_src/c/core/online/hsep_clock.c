#include "hsep_clock.h"

static const double clock_tolerance = 0.05; /* of T_s: importers' times may be whole nanoseconds or single precision */
static const double clock_noticed = 1e-3;   /* of T_s: deviations beyond it are warned of */
static const double clock_spacings = 8.0;   /* of doubles at t: a few roundings of the importer's arithmetic */
static const double clock_split = 134217729.0; /* 2^27 + 1, splits a double into two halves (Veltkamp 1968) */

static double clock_resolution(double t) { return clock_spacings * (nextafter(fabs(t), HUGE_VAL) - fabs(t)); }

/* delta at the end of a step by h to t, s; T_s / 4 at times so large that doubles no longer resolve it. Of several
 * points the nearest counts. */
static double clock_delta(const hsep_clock *self, double t, double h)
{
    const double delta = fmax(clock_tolerance * self->T_s, clock_resolution(t));
    return fmin(fmin(delta, 0.25 * self->T_s), 0.5 * h);
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
    *self = (hsep_clock){.T_s = T_s, .end = start};
    return clock_resolution(start) <= 0.25 * T_s;
}

HSEP_API int hsep_clock_follows(double end, double t, double tolerance)
{
    return fabs(t - end) <= fmax(tolerance, clock_resolution(t));
}

HSEP_API int hsep_clock_latched(const hsep_clock *self) { return self->since > 0.0; }

HSEP_API int hsep_clock_count(const hsep_clock *self, double t, double h, hsep_clock_step *step)
{
    *step = (hsep_clock_step){.after = *self};
    if (!hsep_clock_follows(self->end, t, 0.5 * self->T_s)) {
        return 0;
    }
    hsep_clock *after = &step->after;
    const int latched = hsep_clock_latched(self);
    clock_add(after, h);
    after->end = t + h;
    const double delta = clock_delta(self, after->end, h);
    clock_take(after, floor((after->since + delta) / self->T_s));
    if (after->since < -delta) { /* the quotient was rounded up to the next instant */
        clock_take(after, -1.0);
    }
    step->n_samples = after->k - self->k;
    if (step->n_samples > 0 && after->since <= delta) { /* the instant is at this point, and belongs to the next step */
        step->moved = after->since;
        step->noticed = fabs(step->moved) > clock_noticed * self->T_s;
        after->since = after->carry = 0.0;
    }
    step->n_latched = step->n_samples + hsep_clock_latched(after) - latched;
    step->first = latched ? self->T_s - self->since : 0.0;
    step->inside = step->n_latched > 1 - latched; /* where it is not read yet, the last instant is the step's start */
    return 1;
}

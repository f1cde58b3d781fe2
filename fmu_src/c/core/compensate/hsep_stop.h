/* Stops of plans that are longer than the preview; as stop.py.
 *
 * After the preview a plan takes the command to go on at its last velocity. What comes may be another command, so each
 * plan has a stop beside it: it shares the splines that are carried out before the next plan, then brings the change
 * of the command to a constant within the preview, which takes nothing of the limits of what follows. A plan is carried
 * out as far as it has a stop within the limits; otherwise the last stop goes on.
 */
#ifndef HSEP_STOP_H
#define HSEP_STOP_H

#include "hsep_splines.h"
#include "hsep_window.h"

typedef struct {
    hsep_int preview; /* samples of the command that are known */
    hsep_int shared;  /* splines that a stop has from its plan, a window's and the next plan's pinned ones, */
    hsep_int n;       /* and those before all coefficients are alike */
    hsep_int count;   /* coefficients: the decided ones and of all splines that begin in the preview */
    hsep_int last;    /* (count,) m, the last stop, */
    hsep_int own;     /* (count,) m, by which it differs from one that stops as these do, */
    hsep_int now;     /* (count,) m, and the stop of the plan */
    hsep_int gains;   /* (2 (n - shared),) of the first two differences of coefficients, which make the next one */
    /* (4 preview,) in shares: rows of the last stop without its own part, of the way to the plan's, and of that part */
    hsep_int start, way, own_rows;
} hsep_stop;
HSEP_ASSERT_WORDS(hsep_stop, 11);

static hsep_real hsep_stop_lay_out(hsep_stop *self, const hsep_predictor_parameters *parameters, hsep_int n_pinned)
{
    const hsep_int preview = parameters->preview, spacing = parameters->compensator.spacing;
    hsep_real end = HSEP_WORDS(hsep_stop);
    self->preview = preview;
    self->shared = parameters->settings.Np / spacing + n_pinned;
    self->n = (preview - HSEP_SPLINES_END) / spacing - 2;
    self->count = HSEP_N_DECIDED + (preview + spacing - 1) / spacing;
    self->last = hsep_take(&end, (hsep_real)self->count);
    self->own = hsep_take(&end, (hsep_real)self->count);
    self->now = hsep_take(&end, (hsep_real)self->count);
    self->gains = hsep_take(&end, 2.0 * (hsep_real)(self->n - self->shared));
    self->start = hsep_take(&end, HSEP_ORDERS * (hsep_real)preview);
    self->way = hsep_take(&end, HSEP_ORDERS * (hsep_real)preview);
    self->own_rows = hsep_take(&end, HSEP_ORDERS * (hsep_real)preview);
    return end * sizeof(hsep_real);
}

/* Fill the block, which is 0, with the gains that minimise the sum of squares of the differences of orders 1 to 3, in
 * limits: a backward Riccati recursion (Kalman 1960) from a change that is constant. */
static void hsep_stop_init(
    hsep_stop *self, const hsep_predictor_parameters *parameters, hsep_int n_pinned, const hsep_splines *splines)
{
    (void)hsep_stop_lay_out(self, parameters, n_pinned);
    const hsep_real spacing = (hsep_real)splines->spacing;
    hsep_real of[HSEP_ORDERS] = {0.0}, unit = 1.0, *gains = hsep_at(self, self->gains);
    for (unsigned order = 1; order < HSEP_ORDERS; order++) {
        unit *= spacing;
        of[order] = (splines->share[order] / unit) * (splines->share[order] / unit);
    }
    const hsep_real one = of[1], two = of[2], three = of[3];
    hsep_real p11 = two + 2.0 * three, p12 = three, p22 = three; /* the difference after the last spline is 0 */
    for (hsep_int i = self->n - self->shared; i-- > 0;) {
        const hsep_real both = p12 + p22, total = one + two + three + p11 + p12 + both;
        const hsep_real g1 = (two + three + both) / total, g2 = three / total, h1 = g1 - 1.0, h2 = g2 - 1.0;
        /* The cost of differences x, y before: u = g1 x + g2 y, then u - x, then u - x - y */
        const hsep_real q11 =
            one * g1 * g1 + (two + three) * h1 * h1 + p11 * g1 * g1 + 2.0 * p12 * g1 * h1 + p22 * h1 * h1;
        const hsep_real q12 =
            one * g1 * g2 + two * h1 * g2 + three * h1 * h2 + p11 * g1 * g2 + p12 * (g1 * g2 + h1 * g2) + p22 * h1 * g2;
        p22 = one * g2 * g2 + two * g2 * g2 + three * h2 * h2 + (p11 + 2.0 * p12 + p22) * g2 * g2;
        p11 = q11, p12 = q12;
        gains[2 * i] = g1, gains[2 * i + 1] = g2;
    }
}

/* Stop after decided and shared coefficients, in place, (count,) m. */
static void stop_behind(const hsep_stop *self, hsep_real c[])
{
    const hsep_real *gains = hsep_at_const(self, self->gains);
    hsep_int i = HSEP_N_DECIDED + self->shared;
    hsep_real first = c[i - 1] - c[i - 2], second = first - (c[i - 2] - c[i - 3]);
    for (; i < HSEP_N_DECIDED + self->n; i++, gains += 2) {
        const hsep_real before = first;
        first = gains[0] * first + gains[1] * second;
        second = first - before;
        c[i] = c[i - 1] + first;
    }
    for (; i < self->count; i++) {
        c[i] = c[i - 1];
    }
}

/* Share of the last stop's own part, nearest 0, with which all rows keep their bounds, so far on the way; NaN: none. */
static hsep_real stop_share(const hsep_stop *self, const hsep_real low[], const hsep_real high[], hsep_real length)
{
    const hsep_real *start = hsep_at_const(self, self->start), *way = hsep_at_const(self, self->way);
    const hsep_real *own = hsep_at_const(self, self->own_rows);
    hsep_real least = -HSEP_STOP_MOST, most = HSEP_STOP_MOST;
    for (hsep_int r = 0; r < HSEP_ORDERS * self->preview; r++) {
        const hsep_real row = start[r] + length * way[r];
        if (hsep_fabs(own[r]) > HSEP_STOP_STILL) {
            const hsep_real a = (low[r] - row) / own[r], b = (high[r] - row) / own[r];
            least = hsep_fmax(least, hsep_fmin(a, b));
            most = hsep_fmin(most, hsep_fmax(a, b));
        } else if (!(row >= low[r] && row <= high[r])) {
            return (hsep_real)NAN;
        }
    }
    return least <= most ? hsep_fmin(hsep_fmax(0.0, least), most) : (hsep_real)NAN;
}

/* Shorten a plan, c, to what may be carried out. low, high: (4 preview,) bounds of the rows of a change, which are used
 * up: of the limits and the command, and the last stop at least. */
static void hsep_stop_carry_out(
    hsep_stop *self, const hsep_splines *splines, hsep_real low[], hsep_real high[], hsep_real plan[])
{
    const hsep_int first = HSEP_N_DECIDED + self->shared;
    hsep_real *last = hsep_at(self, self->last), *own = hsep_at(self, self->own), *now = hsep_at(self, self->now);
    hsep_real *start = hsep_at(self, self->start), *way = hsep_at(self, self->way);
    hsep_real *own_rows = hsep_at(self, self->own_rows);
    hsep_real length = 0.0, share = 1.0, too_long = 1.0, tried = 1.0;
    hsep_copy(own, last, first);
    stop_behind(self, own);
    hsep_splines_rows(splines, own, self->count, 0, self->preview, start);
    for (hsep_int i = 0; i < self->count; i++) {
        own[i] = last[i] - own[i];
    }
    hsep_splines_rows(splines, own, self->count, 0, self->preview, own_rows);
    hsep_copy(now, plan, first);
    stop_behind(self, now);
    hsep_splines_rows(splines, now, self->count, 0, self->preview, way);
    for (hsep_int r = 0; r < HSEP_ORDERS * self->preview; r++) {
        low[r] = hsep_fmin(low[r], start[r] + own_rows[r]) - HSEP_LIMITS_ROUNDING;
        high[r] = hsep_fmax(high[r], start[r] + own_rows[r]) + HSEP_LIMITS_ROUNDING;
        way[r] -= start[r];
    }
    for (int tries = 0; tries < HSEP_STOP_TRIES && length < 1.0; tries++) { /* convex, with the last stop in it */
        const hsep_real found = stop_share(self, low, high, tried);
        if (isnan(found)) {
            too_long = tried;
        } else {
            length = tried;
            share = found;
        }
        tried = 0.5 * (length + too_long);
    }
    for (hsep_int i = 0; i < first; i++) {
        last[i] += length * (plan[i] - last[i]);
    }
    stop_behind(self, last);
    hsep_axpy(last, share, own, self->count);
    const hsep_int all = HSEP_N_DECIDED + splines->n, begin = first + self->shared;
    for (hsep_int i = 0; i < all && length < 1.0; i++) { /* after what the next plan shares of it the change fades */
        const hsep_real gone = i > begin ? (hsep_real)(i - begin) / (hsep_real)(all - begin) : 0.0;
        const hsep_real left = 1.0 - gone * gone * gone;
        plan[i] = left * left * left * last[hsep_min(i, self->count - 1)];
    }
}

#endif

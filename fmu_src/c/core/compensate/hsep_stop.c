#include "hsep_stop.h"

#include "hsep_math.h"

#include <string.h>

HSEP_API hsep_real hsep_stop_lay_out(hsep_stop *self, hsep_int preview, hsep_int spacing, hsep_int shared)
{
    hsep_real end = HSEP_WORDS(hsep_stop);
    self->preview = preview;
    self->shared = shared;
    self->n = (preview - HSEP_SPLINES_END) / spacing - 2;
    self->count = HSEP_N_DECIDED + (preview + spacing - 1) / spacing;
    self->last = hsep_take(&end, (hsep_real)self->count);
    self->own = hsep_take(&end, (hsep_real)self->count);
    self->now = hsep_take(&end, (hsep_real)self->count);
    self->gains = hsep_take(&end, 2.0 * (hsep_real)(self->n - shared));
    hsep_int *const of_rows[5] = {&self->low, &self->high, &self->start, &self->way, &self->own_rows};
    for (int i = 0; i < 5; i++) {
        *of_rows[i] = hsep_take(&end, HSEP_ORDERS * (hsep_real)preview);
    }
    return end * sizeof(hsep_real);
}

/* The gains that minimise the sum of squares of the differences of orders 1 to 3, in limits: a backward Riccati
 * recursion (Kalman 1960) from a change that is constant. */
static void stop_gains(hsep_stop *self, const hsep_splines *splines)
{
    const hsep_real spacing = (hsep_real)splines->spacing;
    hsep_real of[HSEP_ORDERS] = {0.0}, unit = 1.0, *gains = hsep_at(self, self->gains);
    for (unsigned order = 1; order < HSEP_ORDERS; order++) {
        unit *= spacing;
        of[order] = (splines->share[order] / unit) * (splines->share[order] / unit);
    }
    const hsep_real one = of[1], two = of[2], three = of[3];
    hsep_real p11 = two + 2.0 * three, p12 = three, p22 = three; /* the difference behind the last spline is 0 */
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

HSEP_API void hsep_stop_init(hsep_stop *self, const hsep_splines *splines, hsep_int preview, hsep_int shared)
{
    (void)hsep_stop_lay_out(self, preview, splines->spacing, shared);
    self->pole = hsep_exp(-HSEP_STOP_FADE * (hsep_real)splines->spacing / (hsep_real)splines->preview);
    stop_gains(self, splines);
}

/* Stop behind decided and shared coefficients, in place, (count,) m. */
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

/* Rows of a change with coefficients c, (count,) m, in shares, (4 preview,). */
static void stop_rows(const hsep_stop *self, const hsep_splines *splines, const hsep_real c[], hsep_real rows[])
{
    hsep_real now[HSEP_ORDERS] = {0.0};
    for (hsep_int k = 0; k < self->preview; k++) {
        hsep_splines_row(splines, now, hsep_splines_sum(splines, c, self->count, k), rows, self->preview, k);
    }
}

/* Bounds of the rows of a change: what limits and command leave, and the last stop at least. */
static void stop_bounds(
    hsep_stop *self, const hsep_splines *splines, const hsep_real x_d[], const hsep_real x_d_before[3],
    const hsep_real delta_before[3])
{
    const hsep_int preview = self->preview;
    const hsep_real most = 1.0 - HSEP_QP_ROUNDING, *start = hsep_at(self, self->start);
    hsep_real *low = hsep_at(self, self->low), *high = hsep_at(self, self->high);
    hsep_real path[HSEP_ORDERS], change[HSEP_ORDERS];
    hsep_splines_exceeded(splines, x_d, x_d_before, preview, low);
    hsep_differ_from(path, x_d_before);
    hsep_differ_from(change, delta_before);
    for (hsep_int k = 0; k < preview; k++) {
        hsep_differ(path, x_d[k]);
        hsep_differ(change, 0.0);
        for (unsigned order = 0; order < HSEP_ORDERS; order++) {
            const hsep_int r = order * preview + k;
            const hsep_real of_x_d = order > 0 ? path[order] : 0.0, exceeded = order > 0 ? low[r] : 0.0;
            const hsep_real offset = (change[order] + of_x_d) * splines->share[order];
            low[r] = hsep_fmin((hsep_fmin(exceeded, 0.0) - most) - offset, start[r]) - HSEP_QP_ROUNDING;
            high[r] = hsep_fmax((hsep_fmax(exceeded, 0.0) + most) - offset, start[r]) + HSEP_QP_ROUNDING;
        }
    }
}

/* Find the share of the last stop's own part, nearest 0, with which all rows keep their bounds, so far on the way to
 * the stop of the plan; return whether there is one. */
static int stop_share(const hsep_stop *self, hsep_real length, hsep_real *share)
{
    const hsep_real *low = hsep_at_const(self, self->low), *high = hsep_at_const(self, self->high);
    const hsep_real *start = hsep_at_const(self, self->start), *way = hsep_at_const(self, self->way);
    const hsep_real *own = hsep_at_const(self, self->own_rows);
    hsep_real least = -INFINITY, most = INFINITY;
    for (hsep_int r = 0; r < HSEP_ORDERS * self->preview; r++) {
        const hsep_real row = start[r] + length * way[r];
        if (hsep_fabs(own[r]) > HSEP_STOP_STILL) {
            const hsep_real a = (low[r] - row) / own[r], b = (high[r] - row) / own[r];
            least = hsep_fmax(least, hsep_fmin(a, b));
            most = hsep_fmin(most, hsep_fmax(a, b));
        } else if (!(row >= low[r] && row <= high[r])) {
            return 0;
        }
    }
    *share = hsep_fmin(hsep_fmax(0.0, least), most);
    return least <= most;
}

HSEP_API void hsep_stop_carry_out(
    hsep_stop *self, const hsep_splines *splines, const hsep_real x_d[], const hsep_real x_d_before[3],
    const hsep_real delta_before[3], hsep_real plan[])
{
    const hsep_int first = HSEP_N_DECIDED + self->shared, rows = HSEP_ORDERS * self->preview;
    const size_t shared = (size_t)first * sizeof(hsep_real);
    hsep_real *last = hsep_at(self, self->last), *own = hsep_at(self, self->own), *now = hsep_at(self, self->now);
    hsep_real *start = hsep_at(self, self->start), *way = hsep_at(self, self->way);
    hsep_real *own_rows = hsep_at(self, self->own_rows), length = 1.0, share = 1.0;
    int tries = 0;
    memcpy(own, last, shared);
    stop_behind(self, own);
    for (hsep_int i = 0; i < self->count; i++) {
        own[i] = last[i] - own[i];
    }
    memcpy(now, plan, shared);
    stop_behind(self, now);
    stop_rows(self, splines, last, start);
    stop_bounds(self, splines, x_d, x_d_before, delta_before);
    stop_rows(self, splines, own, own_rows);
    stop_rows(self, splines, now, way);
    for (hsep_int r = 0; r < rows; r++) {
        start[r] -= own_rows[r];
        way[r] -= start[r];
    }
    for (; tries < HSEP_STOP_TRIES && !stop_share(self, length, &share); tries++) {
        length *= HSEP_STOP_SHORTER;
    }
    if (tries == HSEP_STOP_TRIES) { /* the last stop goes on */
        length = 0.0;
        share = 1.0;
    }
    for (hsep_int i = 0; i < first; i++) {
        last[i] += length * (plan[i] - last[i]);
    }
    stop_behind(self, last);
    if (length < 1.0) { /* behind what is shared the change fades */
        memcpy(plan, last, shared);
        for (hsep_int i = first; i < HSEP_N_DECIDED + splines->n; i++) {
            const hsep_real pole = self->pole;
            plan[i] = 3.0 * pole * plan[i - 1] - 3.0 * pole * pole * plan[i - 2] + pole * pole * pole * plan[i - 3];
        }
    }
    for (hsep_int i = 0; i < self->count; i++) {
        last[i] += share * own[i];
    }
}

HSEP_API void hsep_stop_next(hsep_stop *self, hsep_int kept)
{
    hsep_real *last = hsep_at(self, self->last);
    for (hsep_int i = 0; i < self->count; i++) {
        last[i] = last[i + kept < self->count ? i + kept : self->count - 1];
    }
}

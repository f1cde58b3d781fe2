#include "hsep_constraints.h"

#include "hsep_math.h"

HSEP_API void hsep_constraints_total(hsep_planner *self, const hsep_real x_d[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    const hsep_int preview = splines->preview;
    hsep_real *total = hsep_at(self, self->total), *moves = hsep_at(self, self->moves);
    hsep_real last = self->x_d_before[2];
    hsep_real before[HSEP_ORDERS]; /* differences of orders 0 to 2 at the sample before */
    hsep_real y[3];
    for (int i = 0; i < 3; i++) {
        y[i] = self->x_d_before[i] + self->delta_before[i];
    }
    before[0] = y[2];
    before[1] = y[2] - y[1];
    before[2] = (y[2] - y[1]) - (y[1] - y[0]);
    for (hsep_int k = 0; k < preview; k++) {
        const hsep_real delta = hsep_planner_delta(self, k), step = x_d[k] - last;
        hsep_real now[HSEP_ORDERS];
        last = x_d[k];
        moves[k] = self->no_reversal ? (hsep_real)((step > HSEP_QP_MOVES) - (step < -HSEP_QP_MOVES)) : 0.0;
        now[0] = x_d[k] + delta;
        total[k] = delta * splines->share[0];
        for (unsigned order = 1; order < HSEP_ORDERS; order++) {
            now[order] = now[order - 1] - before[order - 1];
            total[order * preview + k] = now[order] * splines->share[order];
        }
        for (unsigned order = 0; order < HSEP_ORDERS - 1; order++) {
            before[order] = now[order];
        }
    }
}

HSEP_API void hsep_constraints_range(const hsep_planner *self, hsep_int r, hsep_real *least, hsep_real *most)
{
    const hsep_int preview = hsep_planner_splines(self)->preview;
    const hsep_real total = hsep_at_const(self, self->total)[r];
    *most = 1.0 - HSEP_QP_ROUNDING;
    *least = -*most;
    if (r >= preview && r < 2 * preview) { /* velocities */
        const hsep_real moves = hsep_at_const(self, self->moves)[r - preview];
        *least = moves > 0.0 ? 0.0 : *least;
        *most = moves < 0.0 ? 0.0 : *most;
    }
    *least = hsep_fmin(*least, total - HSEP_QP_INTERIOR);
    *most = hsep_fmax(*most, total + HSEP_QP_INTERIOR);
}

HSEP_API hsep_real hsep_constraints_share(const hsep_planner *self, const hsep_real from[], const hsep_real way[])
{
    const hsep_real *total = hsep_at_const(self, self->total);
    const hsep_int rows = HSEP_ORDERS * hsep_planner_splines(self)->preview;
    hsep_real share = 1.0;
    for (hsep_int r = 0; r < rows; r++) {
        hsep_real least, most;
        hsep_constraints_range(self, r, &least, &most);
        const hsep_real here = total[r] + from[r];
        const hsep_real to = hsep_fabs(way[r]), room = way[r] > 0.0 ? most - here : here - least;
        if (to > HSEP_QP_ROUNDING && room < share * to) {
            share = room / to;
        }
    }
    return share;
}

HSEP_API int hsep_constraints_allow(const hsep_planner *self, const hsep_real way[])
{
    const hsep_real *total = hsep_at_const(self, self->total);
    const hsep_int rows = HSEP_ORDERS * hsep_planner_splines(self)->preview;
    for (hsep_int r = 0; r < rows; r++) {
        const hsep_real there = total[r] + way[r];
        hsep_real least, most;
        hsep_constraints_range(self, r, &least, &most);
        if (!(there <= most && there >= least)) {
            return 0;
        }
    }
    return 1;
}

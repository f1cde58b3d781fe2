#include "hsep_constraints.h"

#include <math.h>

static const double constraints_rounding = 1e-9;        /* tolerance for rounding, share of a limit */
static const double constraints_interior_share = 1e-10; /* feasible interval of a row at its bound */
static const double constraints_move = 1e-12;           /* m per sample, smallest step of x_d that counts as motion */

HSEP_API void hsep_constraints_total(hsep_planner *self, const double x_d[])
{
    const hsep_splines *splines = hsep_planner_splines(self);
    const uint64_t preview = splines->preview;
    double *total = hsep_at(self, self->total), *moves = hsep_at(self, self->moves);
    double last = self->x_d_before[2];
    double before[HSEP_ORDERS]; /* differences of orders 0 to 2 at the sample before */
    double y[3];
    for (int i = 0; i < 3; i++) {
        y[i] = self->x_d_before[i] + self->delta_before[i];
    }
    before[0] = y[2];
    before[1] = y[2] - y[1];
    before[2] = (y[2] - y[1]) - (y[1] - y[0]);
    for (uint64_t k = 0; k < preview; k++) {
        const double delta = hsep_planner_delta(self, k), step = x_d[k] - last;
        double now[HSEP_ORDERS];
        last = x_d[k];
        moves[k] = self->no_reversal ? (double)((step > constraints_move) - (step < -constraints_move)) : 0.0;
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

HSEP_API void hsep_constraints_range(const hsep_planner *self, uint64_t r, double *least, double *most)
{
    const uint64_t preview = hsep_planner_splines(self)->preview;
    const double total = hsep_at_const(self, self->total)[r];
    *most = 1.0 - constraints_rounding;
    *least = -*most;
    if (r >= preview && r < 2 * preview) { /* velocities */
        const double moves = hsep_at_const(self, self->moves)[r - preview];
        *least = moves > 0.0 ? 0.0 : *least;
        *most = moves < 0.0 ? 0.0 : *most;
    }
    *least = fmin(*least, total - constraints_interior_share);
    *most = fmax(*most, total + constraints_interior_share);
}

HSEP_API double hsep_constraints_share(const hsep_planner *self, const double way[])
{
    const double *total = hsep_at_const(self, self->total);
    const uint64_t rows = HSEP_ORDERS * hsep_planner_splines(self)->preview;
    double share = 1.0;
    for (uint64_t r = 0; r < rows; r++) {
        double least, most;
        hsep_constraints_range(self, r, &least, &most);
        const double to = fabs(way[r]), room = way[r] > 0.0 ? most - total[r] : total[r] - least;
        if (to > constraints_rounding && room < share * to) {
            share = room / to;
        }
    }
    return share;
}

HSEP_API int hsep_constraints_allow(const hsep_planner *self, const double way[])
{
    const double *total = hsep_at_const(self, self->total);
    const uint64_t rows = HSEP_ORDERS * hsep_planner_splines(self)->preview;
    for (uint64_t r = 0; r < rows; r++) {
        const double there = total[r] + way[r];
        double least, most;
        hsep_constraints_range(self, r, &least, &most);
        if (!(there <= most && there >= least)) {
            return 0;
        }
    }
    return 1;
}

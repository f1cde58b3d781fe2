/* Memory of a planner on the residual model with averaging: its layout and beginning. */
#include "hsep_averaged_planner.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"

#include <string.h>

HSEP_API hsep_real hsep_averaged_planner_lay_out(
    hsep_averaged_planner *self, const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner)
{
    const hsep_int n = hsep_splines_count(planner->preview, planner->spacing);
    const hsep_real all = (hsep_real)parameters->n, coefficients = HSEP_N_DECIDED + (hsep_real)n,
                    filter = hsep_physics_size(parameters->n_modes, parameters->settings->dead_time);
    const hsep_int n_pinned = hsep_planner_n_pinned(planner);
    const hsep_int m = hsep_knots_of(n - n_pinned, planner->Np / planner->spacing).m;
    const hsep_real preview = (hsep_real)planner->preview;
    hsep_real end = HSEP_WORDS(hsep_averaged_planner);
    self->preview = planner->preview;
    self->late = hsep_late(parameters->settings);
    self->p = parameters->settings->p;
    self->Np = planner->Np;
    self->n = n;
    self->m = m;
    const hsep_int fit = n_pinned * planner->spacing / HSEP_NEWTON_STEP;
    self->n_steps = fit < 1 ? 1 : fit < HSEP_AVERAGED_STEPS ? fit : HSEP_AVERAGED_STEPS;
    self->rest = hsep_take(&end, coefficients);
    self->best = hsep_take(&end, coefficients);
    self->of_physics = hsep_take(&end, coefficients);
    self->change = hsep_take(&end, (hsep_real)m);
    self->found = hsep_take(&end, (hsep_real)m);
    self->command = hsep_take(&end, all);
    self->x_pb = hsep_take(&end, all);
    self->e_h = hsep_take(&end, all + (hsep_real)self->p);
    self->target = hsep_take(&end, preview);
    self->weight = hsep_take(&end, preview);
    self->begins = hsep_take(&end, (hsep_real)m);
    self->shapes = hsep_take(&end, HSEP_AVERAGED_SHAPES * (hsep_real)planner->spacing);
    self->passed = hsep_take(&end, HSEP_KNOTS_LEVELS * preview);
    self->gram = hsep_take(&end, hsep_triangle(m));
    self->W = hsep_take(&end, (hsep_real)m * preview);
    self->linearised = hsep_take_block(&end, hsep_linearised_lay_out(&(hsep_linearised){0}, parameters));
    self->physics = hsep_take_block(&end, filter);
    self->trial = hsep_take_block(&end, filter);
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_averaged_planner_init(
    hsep_averaged_planner *self, const hsep_residual_parameters *parameters, const hsep_planner_parameters *planner,
    hsep_real start, hsep_planner *plans, const hsep_real spline[])
{
    (void)hsep_averaged_planner_lay_out(self, parameters, planner);
    self->start = start;
    self->pause =
        (hsep_int)hsep_fmax(1.0, HSEP_PLANNING_RETRY / ((hsep_real)self->Np * parameters->settings->T_s) + 0.5);
    hsep_linearised_init((hsep_linearised *)hsep_at(self, self->linearised), parameters);
    const hsep_int half = self->preview / 2, begin = self->Np > half ? self->Np : half, falling = self->preview - begin;
    hsep_real *weight = hsep_at(self, self->weight);
    for (hsep_int k = 0; k < self->preview; k++) {
        const hsep_real left = (hsep_real)(self->preview - k) / (hsep_real)(falling + 1);
        weight[k] = k < begin ? 1.0 : hsep_fmax(HSEP_SPLINES_LEAST, left);
    }
    hsep_averaged_planner_shape(self, plans, spline);
}

/* Memory of a compensator: its layout and beginning. */
#include "hsep_compensator.h"

#include <stddef.h>
#include <string.h>

HSEP_API hsep_planner *hsep_compensator_planner(hsep_compensator *self)
{
    return (hsep_planner *)hsep_at(self, self->planner);
}

HSEP_API hsep_predictor *hsep_compensator_predictor(hsep_compensator *self)
{
    return (hsep_predictor *)hsep_at(self, self->predictor);
}

HSEP_API hsep_averaged_planner *hsep_compensator_averaged(hsep_compensator *self)
{
    return (hsep_averaged_planner *)hsep_at(self, self->averaged);
}

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real compensator_lay_out(hsep_compensator *self, const hsep_compensator_parameters *parameters)
{
    const hsep_predictor_parameters *predictor = &parameters->predictor;
    const hsep_real preview = (hsep_real)predictor->preview;
    const hsep_residual_parameters model = hsep_predictor_model_parameters(predictor);
    hsep_real end = HSEP_WORDS(hsep_compensator);
    self->n_lost = parameters->n_lost;
    self->x_dm = hsep_take(&end, (hsep_real)predictor->settings.Np);
    self->trial_x = hsep_take(&end, preview + (hsep_real)predictor->settings.q);
    self->trial_e = hsep_take(&end, preview + (hsep_real)predictor->settings.p);
    self->target = hsep_take(&end, preview);
    self->spline_pb = hsep_take(&end, preview);
    self->trial = hsep_take_block(&end, hsep_physics_size(predictor->n_modes, predictor->settings.dead_time));
    self->planner = hsep_take_block(&end, hsep_planner_size(&parameters->planner));
    self->predictor = hsep_take_block(&end, hsep_predictor_block_size(predictor));
    self->averaged = predictor->averaging.averaging
                         ? hsep_take_block(&end, hsep_averaged_planner_size(&model, &parameters->planner))
                         : 0;
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_compensator_block_size(const hsep_compensator_parameters *parameters)
{
    return compensator_lay_out(&(hsep_compensator){0}, parameters);
}

HSEP_API void hsep_compensator_block_init(
    hsep_compensator *self, const hsep_compensator_parameters *parameters, hsep_real start)
{
    const hsep_predictor_parameters *predictor = &parameters->predictor;
    memset(self, 0, (size_t)hsep_compensator_block_size(parameters));
    (void)compensator_lay_out(self, parameters);
    hsep_predictor_block_init(hsep_compensator_predictor(self), predictor, start);
    hsep_planner_init(hsep_compensator_planner(self), &parameters->planner, start);
    if (self->averaged) {
        const hsep_residual_parameters model = hsep_predictor_model_parameters(predictor);
        hsep_averaged_planner_init(hsep_compensator_averaged(self), &model, &parameters->planner, start);
    }
    self->compensate = self->compensate_next = (hsep_int)parameters->compensate;
    self->change_max_next = parameters->planner.limit[0];
    self->error_max = parameters->error_max;
    self->state = self->before = self->compensate > HSEP_SEP_PHYSICS ? HSEP_SEP_PHYSICS : self->compensate;
    /* The spline filtered by the physics model from rest, which is constant. */
    hsep_physics *trial = (hsep_physics *)hsep_at(self, self->trial);
    hsep_real *spline = hsep_at(self, self->spline_pb);
    hsep_physics_init(
        trial, predictor->modes, predictor->n_modes, predictor->settings.dead_time, predictor->settings.T_s,
        (hsep_hold)predictor->settings.input_hold);
    memcpy(
        spline, hsep_splines_shape(hsep_planner_splines(hsep_compensator_planner(self))),
        (size_t)(4 * parameters->planner.spacing) * sizeof(hsep_real));
    hsep_physics_forced_response(trial, spline, spline, (size_t)predictor->preview);
}

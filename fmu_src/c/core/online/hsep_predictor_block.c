/* Memory of a predictor: its layout and beginning. */
#include "hsep_predictor.h"

#include <stddef.h>
#include <string.h>

HSEP_API hsep_physics *hsep_predictor_physics(hsep_predictor *self)
{
    return (hsep_physics *)hsep_at(self, self->physics);
}

HSEP_API hsep_uncertainty *hsep_predictor_uncertainty(hsep_predictor *self)
{
    return (hsep_uncertainty *)hsep_at(self, self->uncertainty);
}

HSEP_API hsep_residual_model *hsep_predictor_model(hsep_predictor *self)
{
    return (hsep_residual_model *)hsep_at(self, self->model);
}

HSEP_API hsep_residual_parameters hsep_predictor_model_parameters(const hsep_predictor_parameters *parameters)
{
    return (hsep_residual_parameters){
        .settings = &parameters->settings,
        .averaging = &parameters->averaging,
        .modes = parameters->modes,
        .n_modes = parameters->n_modes,
        .n = parameters->preview + hsep_late(&parameters->settings),
        .planned = parameters->planned};
}

/* Whether the state at the beginning of the run is corrected: with averaging, alone. */
static int predictor_corrects_start(const hsep_predictor_parameters *parameters)
{
    return parameters->averaging.averaging && !parameters->planned;
}

/* Take a signal of the window, this long, and what is before it; return the offset of the window. */
static hsep_int predictor_take(hsep_real *end, hsep_real late, hsep_real count)
{
    return hsep_take(end, late + count) + (hsep_int)late;
}

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real predictor_lay_out(hsep_predictor *self, const hsep_predictor_parameters *parameters)
{
    const hsep_real Np = (hsep_real)parameters->settings.Np, preview = (hsep_real)parameters->preview;
    const hsep_real late = (hsep_real)hsep_late(&parameters->settings), n = Np + late;
    const hsep_real p = (hsep_real)parameters->settings.p, q = (hsep_real)parameters->settings.q;
    hsep_real end = HSEP_WORDS(hsep_predictor);
    const hsep_residual_parameters model = hsep_predictor_model_parameters(parameters);
    self->Np = parameters->settings.Np;
    self->late = hsep_late(&parameters->settings);
    self->early = parameters->settings.measurement_delay < 0;
    self->n = self->Np + self->late;
    self->preview = parameters->preview;
    self->p = parameters->settings.p;
    self->q = parameters->settings.q;
    self->n_init = parameters->n_init;
    self->ahead = hsep_take(&end, preview);
    self->x_d = predictor_take(&end, late, preview);
    self->x_pb = predictor_take(&end, late, Np);
    self->x_h = predictor_take(&end, late, Np);
    self->x_hold = predictor_take(&end, late, Np);
    self->ahead_pb = hsep_take(&end, parameters->planned ? 0.0 : Np);
    self->command = hsep_take(&end, n);
    self->past_x = hsep_take(&end, n + q);
    self->past_e = hsep_take(&end, n + p);
    self->e_h = parameters->planned ? hsep_take(&end, n + p) : self->past_e;
    self->physics = hsep_take_block(&end, hsep_physics_size(parameters->n_modes, parameters->settings.dead_time));
    self->uncertainty = hsep_take_block(&end, hsep_uncertainty_size(self->Np, self->n));
    self->model = hsep_take_block(&end, hsep_residual_size(&model));
    self->motion = predictor_corrects_start(parameters) ? hsep_take_block(&end, hsep_start_size(&model)) : 0;
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_predictor_block_size(const hsep_predictor_parameters *parameters)
{
    return predictor_lay_out(&(hsep_predictor){0}, parameters);
}

HSEP_API void hsep_predictor_block_init(
    hsep_predictor *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    memset(self, 0, (size_t)hsep_predictor_block_size(parameters));
    (void)predictor_lay_out(self, parameters);
    self->start = self->next = start;
    self->n_published = self->n_physics = self->Np;           /* the first fill is not predicted */
    for (hsep_int i = self->ahead; i < self->ahead_pb; i++) { /* commands, and the four signals of the window */
        hsep_at(self, 0)[i] = start;
    }
    hsep_physics_init(
        hsep_predictor_physics(self), parameters->modes, parameters->n_modes, parameters->settings.dead_time,
        parameters->settings.T_s, (hsep_hold)parameters->settings.input_hold);
    hsep_uncertainty_init(
        hsep_predictor_uncertainty(self), self->Np, self->n,
        hsep_uncertainty_first_variance(parameters->settings.lambda, parameters->averaging.noise_std));
    const hsep_residual_parameters model = hsep_predictor_model_parameters(parameters);
    hsep_residual_init(hsep_predictor_model(self), &model, start);
    if (self->motion) {
        hsep_start_init((hsep_start *)hsep_at(self, self->motion), &model);
    }
}

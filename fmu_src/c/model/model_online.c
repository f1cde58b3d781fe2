/* HybridPredictor and SepCompensator: sizes, initialization, steps and states.
 *
 * Inputs are latched at the instants t_k that lie in a step, outputs belong to the last instant that was reached; the
 * core does the arithmetic. If the resources hold weights (hsep_weights.h), it starts with them.
 */
#include "hsep_online.h"

#if defined(HSEP_ONLINE)

#include "hsep_check.h"
#include "hsep_inputs.h"
#include "hsep_model.h"
#include "hsep_state.h"
#include "hsep_table.h"
#include "hsep_weights.h"
#include "hsep_windows.h"

typedef struct {
    hsep_state_header header;
    hsep_inputs inputs;
    hsep_online online; /* its arrays follow */
} online_state;

/* The arrays behind the struct begin at a multiple of 16 bytes, as an importer's memory does. */
HSEP_ASSERT(alignment_of_online_state, sizeof(online_state) % 16 == 0);

/* Check all parameters and read them; the modes stay in values. */
static hsep_status online_checked(
    const hsep_context *context, const double values[], hsep_online_parameters *parameters, char message[])
{
    message[0] = '\0';
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    const int lags = hsep_check_lags(values[HSEP_VR_Np], values[HSEP_VR_p], values[HSEP_VR_q], message);
    if (hsep_online_check(values, message) + lags > 0) {
        return HSEP_REFUSED;
    }
    hsep_parameters common = {.n_modes = context->n_modes, .modes = hsep_table_modes(context, values)};
#define READ(type, name) common.predictor.name = (type)values[HSEP_VR_##name];
    HSEP_PREDICTOR_SETTINGS(READ)
#undef READ
#define READ(type, name) common.averaging.name = (type)values[HSEP_VR_##name];
    HSEP_AVERAGING_SETTINGS(READ)
#undef READ
    *parameters = hsep_online_derive(values, &common);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    hsep_online_parameters parameters;
    if (online_checked(context, values, &parameters, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    const double before = (double)(sizeof(online_state) - sizeof(hsep_online));
    return hsep_state_size(before + HSEP_ONLINE(block_size)(&parameters), size, message);
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    online_state *self = state;
    hsep_online_parameters parameters;
    const double start = values[HSEP_VR_x_d_ahead];
    if (online_checked(context, values, &parameters, message) != HSEP_OK ||
        hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_begin(&self->header, context, values, needed, size, message) != HSEP_OK ||
        hsep_model_check_start(context, values, message) != HSEP_OK ||
        hsep_inputs_init(&self->inputs, t_start, values[HSEP_VR_T_s], start, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    HSEP_ONLINE(block_init)(&self->online, &parameters, start);
    hsep_predictor *predictor = hsep_online_predictor(&self->online);
    if (hsep_weights_load(context, values, context->n_modes, predictor, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_online_begin(&self->online);
    if (hsep_check_divergence((hsep_divergence)predictor->divergence, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_online_write(&self->online, values);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[])
{
    message[0] = '\0';
    return hsep_check_position(context, "the start value of x_d_ahead", values[HSEP_VR_x_d_ahead], "", 0.0, message);
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    online_state *self = state;
    const double *slopes = values + context->n_variables;
    hsep_predictor *predictor = hsep_online_predictor(&self->online);
    const hsep_residual_model *model = hsep_predictor_model(predictor);
    const hsep_input x_d_ahead = {values[HSEP_VR_x_d_ahead], slopes[HSEP_VR_x_d_ahead]};
    const hsep_input x_meas = {values[HSEP_VR_x_meas], slopes[HSEP_VR_x_meas]};
    hsep_inputs_step step;
    message[0] = '\0';
    if (hsep_check_divergence((hsep_divergence)predictor->divergence, message) != HSEP_OK) { /* of an earlier step */
        return HSEP_REFUSED;
    }
    const hsep_status status = hsep_inputs_count(
        context, &self->inputs, x_d_ahead, x_meas, hsep_residual_may_miss(model), t, h, &step, message);
    if (status == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    hsep_online_tune(&self->online, values);
    while (hsep_inputs_next(&self->inputs, &step)) {
        (void)HSEP_ONLINE(sample)(&self->online, self->inputs.x_d_ahead, self->inputs.x_meas);
        if (hsep_check_divergence((hsep_divergence)predictor->divergence, message) != HSEP_OK) {
            return HSEP_REFUSED;
        }
    }
    hsep_online_write(&self->online, values);
    return status;
}

#if HSEP_N_WINDOWS > 0
HSEP_API hsep_predictor *hsep_model_predictor(void *state) { return &((online_state *)state)->online; }
#endif

#else
typedef int hsep_no_online; /* a translation unit must not be empty */
#endif

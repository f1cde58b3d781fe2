/* HybridPredictor: the look-ahead buffer that predicts the drive's position one window early.
 *
 * Inputs are latched at the instants t_k that lie in a step, outputs are those of the last instant that was reached;
 * the arithmetic is hsep_predictor's. If the resources hold weights (hsep_weights.h), the first window is predicted
 * with them.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)

#include "hsep_check.h"
#include "hsep_inputs.h"
#include "hsep_model.h"
#include "hsep_predictor.h"
#include "hsep_state.h"
#include "hsep_weights.h"

#include <math.h>
#include <string.h>

#define PREDICTOR_KIND UINT64_C(0x4453524550594848) /* any number that no other model has */

typedef struct {
    hsep_state_header header;
    hsep_inputs inputs;
    hsep_predictor predictor; /* its arrays follow */
} predictor_state;

/* The arrays behind the structs begin at a multiple of 16 bytes, as memory of an importer does. */
HSEP_ASSERT(alignment_of_predictor_state, sizeof(predictor_state) % 16 == 0);

/* Read the parameters; those that are whole numbers must have been checked. modes: (HSEP_N_MODES,). */
static hsep_predictor_parameters predictor_parameters(const double values[], double n_init, hsep_mode modes[])
{
    hsep_modes_read(&values[HSEP_VR_mode], HSEP_N_MODES, modes);
    return (hsep_predictor_parameters){
        .Np = (uint64_t)values[HSEP_VR_Np],
        .p = (uint64_t)values[HSEP_VR_p],
        .q = (uint64_t)values[HSEP_VR_q],
        .dead_time = (uint64_t)values[HSEP_VR_dead_time],
        .n_modes = HSEP_N_MODES,
        .lambda = values[HSEP_VR_lambda],
        .T_s = values[HSEP_VR_T_s],
        .n_init = n_init,
        .hold = values[HSEP_VR_input_hold] > 0.0 ? HSEP_FIRST_ORDER_HOLD : HSEP_ZERO_ORDER_HOLD,
        .modes = modes};
}

/* Check all parameters and read them. */
static hsep_status predictor_checked(
    const hsep_context *context, const double values[], hsep_predictor_parameters *parameters, hsep_mode modes[],
    char message[])
{
    message[0] = '\0';
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    const int lags = hsep_check_lags(values[HSEP_VR_Np], values[HSEP_VR_p], values[HSEP_VR_q], message);
    const double n_init = hsep_warm_up_samples(values[HSEP_VR_t_init], values[HSEP_VR_T_s]);
    if (lags > 0) {
        return HSEP_REFUSED;
    }
    *parameters = predictor_parameters(values, n_init, modes);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    hsep_mode modes[HSEP_N_MODES];
    hsep_predictor_parameters parameters;
    if (predictor_checked(context, values, &parameters, modes, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    const double before = (double)(sizeof(predictor_state) - sizeof(hsep_predictor));
    return hsep_state_size(before + hsep_predictor_size(&parameters), size, message);
}

static void predictor_write_outputs(const hsep_predictor *predictor, double values[])
{
    hsep_predictor_outputs outputs;
    hsep_predictor_read(predictor, &outputs);
    values[HSEP_VR_x_d] = outputs.x_d;
    values[HSEP_VR_x_pb] = outputs.x_pb;
    values[HSEP_VR_x_h] = outputs.x_h;
    values[HSEP_VR_e_servo] = outputs.x_d - outputs.x_h; /* the predicted servo error */
    values[HSEP_VR_hybrid_active] = outputs.hybrid_active;
    values[HSEP_VR_rms_pb] = outputs.rms_pb;
    values[HSEP_VR_rms_h] = outputs.rms_h;
    values[HSEP_VR_batch] = (double)outputs.batch;
}

/* Entries past a smaller Np are 0, of a larger Np the first ones are shown. */
static void predictor_write_windows(const hsep_predictor *predictor, double values[])
{
    const uint64_t shown = predictor->Np < HSEP_WINDOW ? predictor->Np : HSEP_WINDOW;
    for (uint64_t i = 0; i < HSEP_WINDOW; i++) {
        values[HSEP_VR_x_d_window + i] = i < shown ? hsep_predictor_array(predictor, predictor->x_d)[i] : 0.0;
        values[HSEP_VR_x_pb_window + i] = i < shown ? hsep_predictor_array(predictor, predictor->x_pb)[i] : 0.0;
        values[HSEP_VR_x_h_window + i] = i < shown ? hsep_predictor_array(predictor, predictor->x_h)[i] : 0.0;
    }
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    predictor_state *self = state;
    hsep_mode modes[HSEP_N_MODES];
    hsep_predictor_parameters parameters;
    size_t needed = 0;
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_fits(needed, size, message) != HSEP_OK ||
        predictor_checked(context, values, &parameters, modes, message) != HSEP_OK ||
        hsep_inputs_init(&self->inputs, t_start, parameters.T_s, values[HSEP_VR_x_d_ahead], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_state_mark(&self->header, context, values, PREDICTOR_KIND, size);
    hsep_predictor_init(&self->predictor, &parameters, values[HSEP_VR_x_d_ahead]);
    const hsep_weights_settings learned = {
        .p = parameters.p,
        .q = parameters.q,
        .input_hold = (uint64_t)parameters.hold,
        .dead_time = parameters.dead_time,
        .n_modes = HSEP_N_MODES,
        .lambda = parameters.lambda,
        .T_s = parameters.T_s,
        .v_s = 0.0,
        .modes = modes};
    if (hsep_weights_load(context, &learned, hsep_predictor_regression(&self->predictor), message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    predictor_write_outputs(&self->predictor, values);
    predictor_write_windows(&self->predictor, values);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    predictor_state *self = state;
    int window = 0;
    hsep_inputs_step step;
    message[0] = '\0';
    if (hsep_check_divergence((hsep_divergence)self->predictor.divergence, message) !=
        HSEP_OK) { /* of an earlier step */
        return HSEP_REFUSED;
    }
    const hsep_status status = hsep_inputs_count(
        &self->inputs, (hsep_input){values[HSEP_VR_x_d_ahead], values[HSEP_SLOPE_x_d_ahead]},
        (hsep_input){values[HSEP_VR_x_meas], values[HSEP_SLOPE_x_meas]}, t, h, &step, message);
    if (status == HSEP_REFUSED) {
        return HSEP_REFUSED;
    }
    while (hsep_inputs_next(&self->inputs, &step)) {
        if (hsep_predictor_sample(&self->predictor, self->inputs.x_d_ahead, self->inputs.x_meas)) {
            window = 1;
        }
        if (hsep_check_divergence((hsep_divergence)self->predictor.divergence, message) != HSEP_OK) {
            return HSEP_REFUSED;
        }
    }
    if (window) {
        predictor_write_windows(&self->predictor, values);
    }
    predictor_write_outputs(&self->predictor, values);
    return status;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    values[HSEP_VR_x_d] = values[HSEP_VR_x_pb] = values[HSEP_VR_x_h] = start;
    values[HSEP_VR_e_servo] = values[HSEP_VR_rms_pb] = values[HSEP_VR_rms_h] = 0.0;
    values[HSEP_VR_hybrid_active] = values[HSEP_VR_batch] = 0.0;
    for (size_t i = 0; i < HSEP_WINDOW; i++) {
        const double position = (double)i < values[HSEP_VR_Np] ? start : 0.0;
        values[HSEP_VR_x_d_window + i] = position;
        values[HSEP_VR_x_pb_window + i] = position;
        values[HSEP_VR_x_h_window + i] = position;
    }
}

HSEP_API hsep_status hsep_model_check_state(
    const hsep_context *context, const void *state, size_t size, const double values[], char message[])
{
    hsep_mode modes[HSEP_N_MODES];
    hsep_predictor_parameters parameters;
    predictor_state head;
    size_t expected = 0;
    if (hsep_model_size(context, values, &expected, message) != HSEP_OK ||
        predictor_checked(context, values, &parameters, modes, message) != HSEP_OK ||
        hsep_state_check(context, values, state, size, PREDICTOR_KIND, expected, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    memcpy(&head, state, sizeof head);
    const char *predictor = (const char *)state + (sizeof head - sizeof head.predictor);
    if (!hsep_inputs_valid(&head.inputs, parameters.T_s, head.predictor.k) ||
        !hsep_predictor_valid(predictor, &parameters)) {
        return hsep_state_damaged(message);
    }
    return HSEP_OK;
}

#else
typedef int hsep_no_hybrid_predictor; /* a translation unit must not be empty */
#endif

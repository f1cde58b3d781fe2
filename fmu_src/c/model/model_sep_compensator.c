/* SepCompensator: the look-ahead buffer that modifies the command so that the drive follows it.
 *
 * Inputs are latched at the instants t_k that lie in a step, outputs are those of the last instant that was reached;
 * the arithmetic is hsep_compensator's. If the resources hold weights (hsep_weights.h), it starts with them.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_SEP_COMPENSATOR)

#include "hsep_check.h"
#include "hsep_compensator.h"
#include "hsep_inputs.h"
#include "hsep_model.h"
#include "hsep_state.h"
#include "hsep_weights.h"

#include <math.h>
#include <string.h>

#define COMPENSATOR_KIND UINT64_C(0x4E45504D4F435053) /* any number that no other model has */

typedef struct {
    hsep_state_header header;
    hsep_inputs inputs;
    hsep_compensator compensator; /* its arrays follow */
} compensator_state;

/* Check spacing and preview against Np; return how many are wrong, each added to message. */
static int compensator_check_plan(const double values[], char message[])
{
    const double Np = values[HSEP_VR_Np], spacing = values[HSEP_VR_spacing], preview = values[HSEP_VR_preview];
    const double least = Np + 4.0 * spacing + 3.0;
    int problems = 0;
    if (fmod(Np, spacing) != 0.0) {
        hsep_message_add(message, "spacing must be " HSEP_AT_LEAST " 1 and divide Np = %.0f, got %.0f", Np, spacing);
        problems++;
    }
    if (preview < least) {
        hsep_message_add(
            message, "preview must be " HSEP_AT_LEAST " Np + 4" HSEP_DOT "spacing + 3 = %.0f, got %.0f", least,
            preview);
        problems++;
    }
    return problems;
}

/* Check all parameters and read them. modes: (HSEP_N_MODES,). */
static hsep_status compensator_checked(
    const hsep_context *context, const double values[], hsep_compensator_parameters *parameters, hsep_mode modes[],
    char message[])
{
    message[0] = '\0';
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    const double T_s = values[HSEP_VR_T_s], t_init = values[HSEP_VR_t_init];
    int problems = hsep_check_lags(values[HSEP_VR_Np], values[HSEP_VR_p], values[HSEP_VR_q], message);
    problems += compensator_check_plan(values, message);
    const double v_max = values[HSEP_VR_v_max] * T_s, a_max = values[HSEP_VR_a_max] * (T_s * T_s);
    const double j_max = values[HSEP_VR_j_max] * (T_s * T_s * T_s), v_s = values[HSEP_VR_v_s];
    /* The warm-up counts from the end of the first fill; without one, the first window is planned with what is
     * known. */
    const double t_plan = t_init > 0.0 ? t_init + values[HSEP_VR_preview] * T_s : 0.0;
    const double n_init = hsep_warm_up_samples(t_plan, T_s);
    if (problems > 0) {
        return HSEP_REFUSED;
    }
    hsep_modes_read(&values[HSEP_VR_mode], HSEP_N_MODES, modes);
    *parameters = (hsep_compensator_parameters){
        .planner =
            {.Np = (uint64_t)values[HSEP_VR_Np],
             .preview = (uint64_t)values[HSEP_VR_preview],
             .spacing = (uint64_t)values[HSEP_VR_spacing],
             .jerk_weight = values[HSEP_VR_jerk_weight],
             .limit = {values[HSEP_VR_change_max], v_max, a_max, j_max},
             .keep_direction = values[HSEP_VR_keep_direction] > 0.0},
        .p = (uint64_t)values[HSEP_VR_p],
        .q = (uint64_t)values[HSEP_VR_q],
        .dead_time = (uint64_t)values[HSEP_VR_dead_time],
        .n_modes = HSEP_N_MODES,
        .lambda = values[HSEP_VR_lambda],
        .T_s = T_s,
        .v_s = v_s,
        .n_init = n_init,
        .hold = values[HSEP_VR_input_hold] > 0.0 ? HSEP_FIRST_ORDER_HOLD : HSEP_ZERO_ORDER_HOLD,
        .best = (hsep_sep_state)values[HSEP_VR_compensate],
        .modes = modes};
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    hsep_mode modes[HSEP_N_MODES];
    hsep_compensator_parameters parameters;
    if (compensator_checked(context, values, &parameters, modes, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    const double before = (double)(sizeof(compensator_state) - sizeof(hsep_compensator));
    return hsep_state_size(before + hsep_compensator_size(&parameters), size, message);
}

static void compensator_write_outputs(const hsep_compensator *compensator, double values[])
{
    hsep_compensator_outputs outputs;
    hsep_compensator_read(compensator, &outputs);
    values[HSEP_VR_x_dm] = outputs.x_dm;
    values[HSEP_VR_x_d] = outputs.x_d;
    values[HSEP_VR_x_pb] = outputs.x_pb;
    values[HSEP_VR_x_h] = outputs.x_h;
    values[HSEP_VR_e_servo] = outputs.x_d - outputs.x_h; /* the predicted servo error that is left */
    values[HSEP_VR_sep_state] = (double)outputs.state;
    values[HSEP_VR_rms_e] = outputs.rms_e;
    values[HSEP_VR_rms_pb] = outputs.rms_pb;
    values[HSEP_VR_rms_h] = outputs.rms_h;
    values[HSEP_VR_batch] = (double)outputs.batch;
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    compensator_state *self = state;
    hsep_mode modes[HSEP_N_MODES];
    hsep_compensator_parameters parameters;
    size_t needed = 0;
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_fits(needed, size, message) != HSEP_OK ||
        compensator_checked(context, values, &parameters, modes, message) != HSEP_OK ||
        hsep_inputs_init(&self->inputs, t_start, parameters.T_s, values[HSEP_VR_x_d_ahead], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_state_mark(&self->header, context, values, COMPENSATOR_KIND, size);
    hsep_compensator_init(&self->compensator, &parameters, values[HSEP_VR_x_d_ahead]);
    const hsep_weights_settings learned = {
        .p = parameters.p,
        .q = parameters.q,
        .input_hold = (uint64_t)parameters.hold,
        .dead_time = parameters.dead_time,
        .n_modes = HSEP_N_MODES,
        .lambda = parameters.lambda,
        .T_s = parameters.T_s,
        .v_s = parameters.v_s,
        .modes = modes};
    if (hsep_weights_load(context, &learned, hsep_compensator_regression(&self->compensator), message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_compensator_begin(&self->compensator);
    if (hsep_check_divergence((hsep_divergence)self->compensator.divergence, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    compensator_write_outputs(&self->compensator, values);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    compensator_state *self = state;
    hsep_inputs_step step;
    message[0] = '\0';
    if (hsep_check_divergence((hsep_divergence)self->compensator.divergence, message) !=
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
        hsep_compensator_sample(&self->compensator, self->inputs.x_d_ahead, self->inputs.x_meas);
        if (hsep_check_divergence((hsep_divergence)self->compensator.divergence, message) != HSEP_OK) {
            return HSEP_REFUSED;
        }
    }
    compensator_write_outputs(&self->compensator, values);
    return status;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double start = values[HSEP_VR_x_d_ahead]; /* the drive rests there */
    values[HSEP_VR_x_dm] = values[HSEP_VR_x_d] = values[HSEP_VR_x_pb] = values[HSEP_VR_x_h] = start;
    values[HSEP_VR_e_servo] = values[HSEP_VR_rms_e] = values[HSEP_VR_rms_pb] = values[HSEP_VR_rms_h] = 0.0;
    values[HSEP_VR_batch] = 0.0;
    values[HSEP_VR_sep_state] = values[HSEP_VR_compensate] > 0.0 ? 1.0 : 0.0;
}

HSEP_API hsep_status hsep_model_check_state(
    const hsep_context *context, const void *state, size_t size, const double values[], char message[])
{
    hsep_mode modes[HSEP_N_MODES];
    hsep_compensator_parameters parameters;
    compensator_state head;
    size_t expected = 0;
    if (hsep_model_size(context, values, &expected, message) != HSEP_OK ||
        compensator_checked(context, values, &parameters, modes, message) != HSEP_OK ||
        hsep_state_check(context, values, state, size, COMPENSATOR_KIND, expected, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    memcpy(&head, state, sizeof head);
    const char *compensator = (const char *)state + (sizeof head - sizeof head.compensator);
    if (!hsep_inputs_valid(&head.inputs, parameters.T_s, head.compensator.k) ||
        !hsep_compensator_valid(compensator, &parameters)) {
        return hsep_state_damaged(message);
    }
    return HSEP_OK;
}

#else
typedef int hsep_no_sep_compensator; /* a translation unit must not be empty */
#endif

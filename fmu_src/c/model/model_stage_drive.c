/* FeedDrive of a linear-motor stage: modes, with friction and cable stiffness, and an encoder.
 *
 * The command is constant over a step of any length up to 100 s. The encoder draws once when the initialization ends
 * and once a step. Cost of a step: 4 slopes of all modes for each 0.1 ms of it.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_STAGE_DRIVE)

#include "hsep_check.h"
#include "hsep_drive.h"
#include "hsep_encoder.h"
#include "hsep_model.h"
#include "hsep_plant.h"
#include "hsep_state.h"

#include <string.h>

#define STAGE_DRIVE_KIND UINT64_C(0x4556495244475453) /* any number that no other model has */

typedef struct {
    hsep_state_header header;
    hsep_encoder encoder;
    hsep_stage stage; /* its modes follow */
} stage_drive_state;

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    message[0] = '\0';
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    hsep_mode modes[HSEP_N_MODES];
    hsep_modes_read(&values[HSEP_VR_mode], HSEP_N_MODES, modes);
    for (int i = 0; i < HSEP_N_MODES; i++) {
        const double rate = hsep_plant_mode_rate(&modes[i]);
        if (rate > HSEP_PLANT_RATE_MAX) {
            hsep_message_add(
                message,
                "2 pi f_n and 4 pi f_n zeta of mode[%d] must be at most %g 1/s in a plant, got %g; lower f_n or zeta",
                i + 1, HSEP_PLANT_RATE_MAX, rate);
            return HSEP_REFUSED;
        }
    }
    const double before = (double)(sizeof(stage_drive_state) - sizeof(hsep_stage));
    return hsep_state_size(before + hsep_stage_size(HSEP_N_MODES), size, message);
}

static void stage_drive_write_outputs(const stage_drive_state *self, double values[], double x_meas)
{
    values[HSEP_VR_x] = hsep_stage_x(&self->stage);
    values[HSEP_VR_v] = self->stage.v;
    values[HSEP_VR_x_meas] = x_meas;
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    stage_drive_state *self = state;
    hsep_mode modes[HSEP_N_MODES];
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_begin(&self->header, context, values, STAGE_DRIVE_KIND, needed, size, message) != HSEP_OK ||
        hsep_check_start_time(t_start, message) != HSEP_OK ||
        hsep_drive_check_start(values[HSEP_VR_x_d], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_encoder_init(&self->encoder, values[HSEP_VR_noise_std], (uint64_t)values[HSEP_VR_seed]);
    hsep_modes_read(&values[HSEP_VR_mode], HSEP_N_MODES, modes);
    hsep_stage_init(
        &self->stage, modes, HSEP_N_MODES, values[HSEP_VR_f], values[HSEP_VR_kappa], values[HSEP_VR_T_s],
        values[HSEP_VR_x_d]);
    const double x_meas = hsep_encoder_measure(&self->encoder, hsep_stage_x(&self->stage));
    stage_drive_write_outputs(self, values, x_meas);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    stage_drive_state *self = state;
    double work[HSEP_STAGE_WORK * HSEP_N_MODES] = {0.0}; /* zeros, because gcc cannot see that all of it is filled */
    message[0] = '\0';
    if (hsep_drive_check(values[HSEP_VR_x_d], t, h, hsep_stage_rate(&self->stage), message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!hsep_stage_step(&self->stage, values[HSEP_VR_x_d], h, work)) {
        hsep_message_add(message, "the stage's state overflowed (command %g m)", values[HSEP_VR_x_d]);
        return HSEP_REFUSED;
    }
    const double x_meas = hsep_encoder_measure(&self->encoder, hsep_stage_x(&self->stage));
    stage_drive_write_outputs(self, values, x_meas);
    return HSEP_OK;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double x = values[HSEP_VR_x_d]; /* the stage rests there */
    values[HSEP_VR_x] = x;
    values[HSEP_VR_v] = 0.0;
    values[HSEP_VR_x_meas] = hsep_drive_first_measurement(values[HSEP_VR_noise_std], values[HSEP_VR_seed], x);
}

HSEP_API hsep_status hsep_model_check_state(
    const hsep_context *context, const void *state, size_t size, const double values[], char message[])
{
    size_t expected = 0;
    stage_drive_state head;
    if (hsep_model_size(context, values, &expected, message) != HSEP_OK ||
        hsep_state_check(context, values, state, size, STAGE_DRIVE_KIND, expected, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    memcpy(&head, state, sizeof head);
    const char *modes = (const char *)state + sizeof head;
    const double numbers[] = {head.encoder.noise_std, head.stage.f,   head.stage.kappa, head.stage.start,
                              head.stage.last_x_d,    head.stage.v_d, head.stage.v};
    const int finite = hsep_within(numbers, sizeof numbers / sizeof *numbers, HSEP_PREDICTION_MAX) &&
                       hsep_within(modes, (size - sizeof head) / sizeof(double), HSEP_PREDICTION_MAX);
    if (!finite || !hsep_stage_valid(modes - sizeof head.stage, HSEP_N_MODES) ||
        head.stage.clock.T_s != values[HSEP_VR_T_s]) {
        return hsep_state_damaged(message);
    }
    return HSEP_OK;
}

#else
typedef int hsep_no_stage_drive; /* a translation unit must not be empty */
#endif

/* FeedDrive: the nonlinear drive of eq. (13) with its encoder.
 *
 * The command is constant over a step of any length up to 100 s. The encoder draws once when the initialization ends
 * and once a step. Cost of a step: 4 slopes for each 0.1 ms of it.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_FEED_DRIVE)

#include "hsep_check.h"
#include "hsep_drive.h"
#include "hsep_encoder.h"
#include "hsep_model.h"
#include "hsep_plant.h"
#include "hsep_state.h"

#include <string.h>

#define FEED_DRIVE_KIND UINT64_C(0x4556495244444546) /* any number that no other model has */

typedef struct {
    hsep_state_header header;
    hsep_encoder encoder;
    hsep_feed_drive drive;
} feed_drive_state;

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    message[0] = '\0';
    *size = sizeof(feed_drive_state);
    if (hsep_check_parameters(context, values, message) > 0) {
        return HSEP_REFUSED;
    }
    const double rate = hsep_feed_drive_rate(
        &(hsep_feed_drive){.m = values[HSEP_VR_m], .c = values[HSEP_VR_c], .k = values[HSEP_VR_k]});
    if (rate > HSEP_PLANT_RATE_MAX) {
        hsep_message_add(
            message, "sqrt(k/m) and c/m must be at most %g 1/s, got %g; lower k or c, or raise m", HSEP_PLANT_RATE_MAX,
            rate);
        return HSEP_REFUSED;
    }
    return HSEP_OK;
}

static void feed_drive_write_outputs(const feed_drive_state *self, double values[], double x_meas)
{
    values[HSEP_VR_x] = hsep_feed_drive_x(&self->drive);
    values[HSEP_VR_v] = hsep_feed_drive_v(&self->drive);
    values[HSEP_VR_x_meas] = x_meas;
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    feed_drive_state *self = state;
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_begin(&self->header, context, values, FEED_DRIVE_KIND, needed, size, message) != HSEP_OK ||
        hsep_check_start_time(t_start, message) != HSEP_OK ||
        hsep_drive_check_start(values[HSEP_VR_x_d], message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    hsep_encoder_init(&self->encoder, values[HSEP_VR_noise_std], (uint64_t)values[HSEP_VR_seed]);
    self->drive.m = values[HSEP_VR_m];
    self->drive.c = values[HSEP_VR_c];
    self->drive.k = values[HSEP_VR_k];
    self->drive.c_nl = values[HSEP_VR_c_nl];
    self->drive.k_nl = values[HSEP_VR_k_nl];
    hsep_feed_drive_reset(&self->drive, values[HSEP_VR_x_d]);
    const double x_meas = hsep_encoder_measure(&self->encoder, hsep_feed_drive_x(&self->drive));
    feed_drive_write_outputs(self, values, x_meas);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    feed_drive_state *self = state;
    double x = 0.0;
    message[0] = '\0';
    if (hsep_drive_check(values[HSEP_VR_x_d], t, h, hsep_feed_drive_rate(&self->drive), message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!hsep_feed_drive_step(&self->drive, values[HSEP_VR_x_d], h, &x)) {
        return hsep_drive_overflowed(x, values[HSEP_VR_x_d], message);
    }
    const double x_meas = hsep_encoder_measure(&self->encoder, hsep_feed_drive_x(&self->drive));
    feed_drive_write_outputs(self, values, x_meas);
    return HSEP_OK;
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double x = values[HSEP_VR_x_d]; /* the drive rests there */
    values[HSEP_VR_x] = x;
    values[HSEP_VR_v] = 0.0;
    values[HSEP_VR_x_meas] = hsep_drive_first_measurement(values[HSEP_VR_noise_std], values[HSEP_VR_seed], x);
}

HSEP_API hsep_status hsep_model_check_state(
    const hsep_context *context, const void *state, size_t size, const double values[], char message[])
{
    size_t expected = 0;
    feed_drive_state head;
    if (hsep_model_size(context, values, &expected, message) != HSEP_OK ||
        hsep_state_check(context, values, state, size, FEED_DRIVE_KIND, expected, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    memcpy(&head, state, sizeof head);
    const int finite = hsep_within(&head.encoder.noise_std, 1, HSEP_PREDICTION_MAX) &&
                       hsep_within(&head.drive, sizeof head.drive / sizeof(double), HSEP_PREDICTION_MAX);
    return finite ? HSEP_OK : hsep_state_damaged(message);
}

#else
typedef int hsep_no_feed_drive; /* a translation unit must not be empty */
#endif

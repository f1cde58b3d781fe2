/* FeedDrive: a drive with its encoder.
 *
 * The command is constant over a step of any length up to 100 s. The encoder draws once when the initialization ends
 * and once a step. Cost of a step: 4 slopes for each 0.1 ms of it.
 */
#include "hsep_drive.h"

#if defined(HSEP_DRIVE)

#include "hsep_check.h"
#include "hsep_encoder.h"
#include "hsep_model.h"
#include "hsep_state.h"

#include <math.h>

static const double drive_seed_max = 2147483647.0;
static const double drive_time_tolerance = 0.5; /* of a step: rounding of the importer's times */

typedef struct {
    hsep_state_header header;
    double end; /* s, of the last step in the importer's time */
    hsep_encoder encoder;
    hsep_drive drive; /* its arrays may follow */
} drive_state;

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    double bytes = 0.0;
    message[0] = '\0';
    if (hsep_check_parameters(context, values, message) > 0 ||
        hsep_drive_check(context, values, &bytes, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    return hsep_state_size((double)offsetof(drive_state, drive) + bytes, size, message);
}

/* Measure the position and write all outputs. */
static void drive_write_outputs(drive_state *self, double values[])
{
    values[HSEP_VR_x] = HSEP_DRIVE(x)(&self->drive);
    values[HSEP_VR_v] = hsep_drive_velocity(&self->drive);
    values[HSEP_VR_x_meas] = hsep_encoder_measure(&self->encoder, values[HSEP_VR_x]);
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    drive_state *self = state;
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_state_begin(&self->header, context, values, needed, size, message) != HSEP_OK ||
        hsep_check_start_time(t_start, message) != HSEP_OK ||
        hsep_model_check_start(context, values, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->end = t_start;
    hsep_encoder_init(&self->encoder, values[HSEP_VR_noise_std], (uint64_t)values[HSEP_VR_seed]);
    hsep_drive_begin(context, &self->drive, values);
    drive_write_outputs(self, values);
    return HSEP_OK;
}

/* Check the command x_d, m, and the step from t by h, s; a step is at most 100 s and hsep_plant_step_max long, which
 * bounds its cost. */
static hsep_status drive_check_step(
    const hsep_context *context, const drive_state *self, double x_d, double t, double h, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    const double rate = HSEP_DRIVE(rate)(&self->drive);
    if (hsep_check_position(context, "x_d", x_d, " at t = %g s", t, message) != HSEP_OK ||
        hsep_check_step_size(h, message) != HSEP_OK ||
        hsep_check_point(self->end, t, drive_time_tolerance * h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (h > hsep_plant_step_max(rate)) {
        return hsep_message_add(
            message, "the step size must be at most %g s for a drive as fast as %g 1/s, got %s; make several steps",
            hsep_plant_step_max(rate), rate, hsep_number(number, h, HSEP_REAL));
    }
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    (void)context;
    drive_state *self = state;
    const double x_d = values[HSEP_VR_x_d];
    message[0] = '\0';
    if (drive_check_step(context, self, x_d, t, h, message) != HSEP_OK ||
        hsep_drive_step(&self->drive, x_d, h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->end = t + h;
    drive_write_outputs(self, values);
    return HSEP_OK;
}

/* The first measurement of a drive at rest at x, m; x itself if noise_std or seed is out of range. */
static double drive_first_measurement(double noise_std, double seed, double x)
{
    if (!(noise_std >= 0.0 && isfinite(noise_std) && seed >= 0.0 && seed <= drive_seed_max)) {
        return x;
    }
    hsep_encoder encoder;
    hsep_encoder_init(&encoder, noise_std, (uint64_t)seed);
    const double measured = hsep_encoder_measure(&encoder, x);
    return isfinite(measured) ? measured : x;
}

HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[])
{
    message[0] = '\0';
    return hsep_check_position(context, "the start value of x_d", values[HSEP_VR_x_d], "", 0.0, message);
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    (void)context;
    const double x = values[HSEP_VR_x_d]; /* the drive rests there */
    values[HSEP_VR_x] = x;
    values[HSEP_VR_v] = 0.0;
    values[HSEP_VR_x_meas] = drive_first_measurement(values[HSEP_VR_noise_std], values[HSEP_VR_seed], x);
}

#else
typedef int hsep_no_drive; /* a translation unit must not be empty */
#endif

/* FeedDrive: a drive with its encoder, the nonlinear one of eq. (13), or a linear-motor stage: modes, with friction and
 * cable stiffness. One of them is compiled into an FMU.
 *
 * The command is constant over a step of any length up to 100 s. The encoder draws once when the initialization ends
 * and once a step. Cost of a step: 4 slopes for each 0.1 ms of it.
 */
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_FEED_DRIVE) || defined(HSEP_MODEL_STAGE_DRIVE)

#include "hsep_check.h"
#include "hsep_plant.h"
#include "hsep_table.h"

#if defined(HSEP_MODEL_FEED_DRIVE)
#define DRIVE(function) hsep_feed_drive_##function
typedef hsep_feed_drive drive_plant;
#else
#define DRIVE(function) hsep_stage_##function
typedef hsep_stage drive_plant;
#endif

static const double drive_time_tolerance = 0.5; /* of a step: rounding of the importer's times */

typedef struct {
    double end; /* s, of the last step in the importer's time */
    hsep_encoder encoder;
    drive_plant plant; /* its arrays may follow */
} drive_state;

/* The plant's own ---------------------------------------------------------------------------------------------------
 * drive_check: of its parameters together, after each of them; *bytes: of its block, counted in double. drive_begin: at
 * rest at the start value of x_d. drive_step: by h, s, with the command x_d, m, held; fails, with the state unchanged,
 * if the state overflows. */

#if defined(HSEP_MODEL_FEED_DRIVE)

static hsep_status drive_check(const hsep_context *context, const double values[], double *bytes, char message[])
{
    (void)context;
    const double rate = hsep_feed_drive_rate(
        &(hsep_feed_drive){.m = values[HSEP_VR_m], .c = values[HSEP_VR_c], .k = values[HSEP_VR_k]});
    *bytes = sizeof(hsep_feed_drive);
    if (rate > HSEP_PLANT_RATE_MAX) {
        return hsep_message_add(
            message, "sqrt(k/m) and c/m must be at most %g 1/s, got %g; lower k or c, or raise m", HSEP_PLANT_RATE_MAX,
            rate);
    }
    return HSEP_OK;
}

static void drive_begin(const hsep_context *context, hsep_feed_drive *self, const double values[])
{
    (void)context;
    *self = (hsep_feed_drive){
        .m = values[HSEP_VR_m],
        .c = values[HSEP_VR_c],
        .k = values[HSEP_VR_k],
        .c_nl = values[HSEP_VR_c_nl],
        .k_nl = values[HSEP_VR_k_nl],
        .start = values[HSEP_VR_x_d]};
}

static hsep_status drive_step(hsep_feed_drive *self, double x_d, double h, char message[])
{
    double x = 0.0;
    if (!hsep_feed_drive_step(self, x_d, h, &x)) {
        return hsep_message_add(message, "the drive's state overflowed (x = %s, command %g m)", HSEP_SHOWN(x), x_d);
    }
    return HSEP_OK;
}

#else

static hsep_stage_settings stage_settings(const double values[])
{
    return (hsep_stage_settings){
        .f = values[HSEP_VR_f],
        .kappa = values[HSEP_VR_kappa],
        .v_friction = values[HSEP_VR_v_friction],
        .friction_on = (uint64_t)values[HSEP_VR_friction_on],
        .dead_time = (uint64_t)values[HSEP_VR_dead_time],
        .input_hold = (uint64_t)values[HSEP_VR_input_hold],
    };
}

static hsep_status drive_check(const hsep_context *context, const double values[], double *bytes, char message[])
{
    const hsep_mode *modes = hsep_table_modes(context, values);
    const hsep_stage_settings settings = stage_settings(values);
    *bytes = hsep_stage_lay_out(&(hsep_stage){0}, context->n_modes, &settings);
    for (size_t i = 0; i < context->n_modes; i++) {
        const double rate = hsep_plant_mode_rate(&modes[i]);
        if (rate > HSEP_PLANT_RATE_MAX) {
            return hsep_message_add(
                message,
                "2 pi f_n and 4 pi f_n zeta of mode[%lu] must be at most %g 1/s in a plant, got %g; lower f_n or zeta",
                (unsigned long)i + 1, HSEP_PLANT_RATE_MAX, rate);
        }
    }
    return HSEP_OK;
}

static void drive_begin(const hsep_context *context, hsep_stage *self, const double values[])
{
    const hsep_stage_settings settings = stage_settings(values);
    hsep_stage_init(
        self, hsep_table_modes(context, values), context->n_modes, &settings, values[HSEP_VR_T_s], values[HSEP_VR_x_d]);
}

static hsep_status drive_step(hsep_stage *self, double x_d, double h, char message[])
{
    if (!hsep_stage_step(self, x_d, h)) {
        return hsep_message_add(message, "the stage's state overflowed (command %g m)", x_d);
    }
    return HSEP_OK;
}

#endif

/* Both plants' ---------------------------------------------------------------------------------------------------- */

HSEP_API hsep_status hsep_model_size(const hsep_context *context, const double values[], size_t *size, char message[])
{
    double bytes = 0.0;
    if (hsep_check_parameters(context, values, message) > 0 ||
        drive_check(context, values, &bytes, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    return hsep_check_bytes((double)offsetof(drive_state, plant) + bytes, size, message);
}

/* Measure the position and write all outputs. */
static void drive_write_outputs(drive_state *self, double values[])
{
    values[HSEP_VR_x] = DRIVE(x)(&self->plant);
    values[HSEP_VR_v] = DRIVE(v)(&self->plant);
    values[HSEP_VR_x_meas] = hsep_encoder_measure(&self->encoder, values[HSEP_VR_x]);
}

HSEP_API hsep_status hsep_model_initialise(
    const hsep_context *context, void *state, size_t size, double values[], double t_start, char message[])
{
    size_t needed = 0;
    drive_state *self = state;
    if (hsep_model_size(context, values, &needed, message) != HSEP_OK ||
        hsep_check_memory(needed, size, message) != HSEP_OK || hsep_check_start_time(t_start, message) != HSEP_OK ||
        hsep_model_check_start(context, values, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->end = t_start;
    self->encoder = (hsep_encoder){.noise_std = values[HSEP_VR_noise_std], .seed = (uint64_t)values[HSEP_VR_seed]};
    drive_begin(context, &self->plant, values);
    drive_write_outputs(self, values);
    return HSEP_OK;
}

HSEP_API hsep_status
hsep_model_step(const hsep_context *context, void *state, double values[], double t, double h, char message[])
{
    drive_state *self = state;
    const double x_d = values[HSEP_VR_x_d], rate = DRIVE(rate)(&self->plant);
    if (hsep_check_position(context, "x_d", x_d, " at t = %g s", t, message) != HSEP_OK ||
        hsep_check_step_size(h, message) != HSEP_OK ||
        hsep_check_point(self->end, t, drive_time_tolerance * h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (h > hsep_plant_step_max(rate)) {
        return hsep_message_add(
            message, "the step size must be at most %g s for a drive as fast as %g 1/s, got %s; make several steps",
            hsep_plant_step_max(rate), rate, HSEP_SHOWN(h));
    }
    if (drive_step(&self->plant, x_d, h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    self->end = t + h;
    drive_write_outputs(self, values);
    return HSEP_OK;
}

HSEP_API hsep_status hsep_model_check_start(const hsep_context *context, const double values[], char message[])
{
    return hsep_check_position(context, "the start value of x_d", values[HSEP_VR_x_d], "", 0.0, message);
}

HSEP_API void hsep_model_start_values(const hsep_context *context, double values[])
{
    const double x = values[HSEP_VR_x_d]; /* the drive rests there */
    const double noise_std = values[HSEP_VR_noise_std], seed = values[HSEP_VR_seed];
    char message[HSEP_MESSAGE_SIZE] = "";
    values[HSEP_VR_x] = values[HSEP_VR_x_meas] = x;
    values[HSEP_VR_v] = 0.0;
    if (hsep_check_parameter(context, HSEP_VR_noise_std, noise_std, message) &&
        hsep_check_parameter(context, HSEP_VR_seed, seed, message)) {
        hsep_encoder encoder = {.noise_std = noise_std, .seed = (uint64_t)seed};
        values[HSEP_VR_x_meas] = hsep_encoder_measure(&encoder, x);
    }
}

#endif

/* FeedDrive of a linear-motor stage: modes, with friction and cable stiffness. */
#include "hsep_drive.h"

#if defined(HSEP_MODEL_STAGE_DRIVE)

#include "hsep_check.h"
#include "hsep_table.h"

#include <string.h>

/* Work space for a step lies behind the stage: zeros between steps. */
static size_t stage_work_size(uint64_t n_modes) { return (size_t)(HSEP_STAGE_WORK * n_modes) * sizeof(double); }

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

HSEP_API hsep_status hsep_drive_check(const hsep_context *context, const double values[], double *bytes, char message[])
{
    const hsep_mode *modes = hsep_table_modes(context, values);
    const hsep_stage_settings settings = stage_settings(values);
    *bytes = hsep_stage_size(context->n_modes, &settings) + (double)stage_work_size(context->n_modes);
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

HSEP_API void hsep_drive_begin(const hsep_context *context, hsep_drive *self, const double values[])
{
    const hsep_stage_settings settings = stage_settings(values);
    hsep_stage_init(
        self, hsep_table_modes(context, values), context->n_modes, &settings, values[HSEP_VR_T_s], values[HSEP_VR_x_d]);
}

HSEP_API hsep_status hsep_drive_step(hsep_drive *self, double x_d, double h, char message[])
{
    double *work = hsep_at(self, (uint64_t)hsep_stage_size(self->n_modes, &self->settings) / sizeof(double));
    const int done = hsep_stage_step(self, x_d, h, work);
    memset(work, 0, stage_work_size(self->n_modes));
    if (!done) {
        return hsep_message_add(message, "the stage's state overflowed (command %g m)", x_d);
    }
    return HSEP_OK;
}

HSEP_API double hsep_drive_velocity(const hsep_drive *self) { return self->v; }

#else
typedef int hsep_no_stage_drive; /* a translation unit must not be empty */
#endif

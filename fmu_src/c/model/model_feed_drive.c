/* FeedDrive: the nonlinear drive of eq. (13). */
#include "hsep_drive.h"

#if defined(HSEP_MODEL_FEED_DRIVE)

#include "hsep_check.h"

HSEP_API hsep_status hsep_drive_check(const hsep_context *context, const double values[], double *bytes, char message[])
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

HSEP_API void hsep_drive_begin(const hsep_context *context, hsep_drive *self, const double values[])
{
    (void)context;
    self->m = values[HSEP_VR_m];
    self->c = values[HSEP_VR_c];
    self->k = values[HSEP_VR_k];
    self->c_nl = values[HSEP_VR_c_nl];
    self->k_nl = values[HSEP_VR_k_nl];
    hsep_feed_drive_reset(self, values[HSEP_VR_x_d]);
}

HSEP_API hsep_status hsep_drive_step(hsep_drive *self, double x_d, double h, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    double x = 0.0;
    if (!hsep_feed_drive_step(self, x_d, h, &x)) {
        return hsep_message_add(
            message, "the drive's state overflowed (x = %s, command %g m)", hsep_number(number, x, HSEP_REAL), x_d);
    }
    return HSEP_OK;
}

HSEP_API double hsep_drive_velocity(const hsep_drive *self) { return hsep_feed_drive_v(self); }

#else
typedef int hsep_no_feed_drive; /* a translation unit must not be empty */
#endif

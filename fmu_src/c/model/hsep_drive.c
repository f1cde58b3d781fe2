#include "hsep_drive.h"

#include "hsep_check.h"
#include "hsep_plant.h"

#include <math.h>

static const double drive_seed_max = 2147483647.0;

HSEP_API hsep_status hsep_drive_check(double x_d, double t, double h, double rate, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    if (hsep_check_position("x_d", x_d, " at t = %g s", t, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!isfinite(t)) {
        hsep_message_add(
            message, "the communication point must be finite, got %s s", hsep_number(number, t, HSEP_REAL));
    } else if (hsep_check_step_size(h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    } else if (h > hsep_plant_step_max(rate)) {
        hsep_message_add(
            message, "the step size must be at most %g s for a drive as fast as %g 1/s, got %s; make several steps",
            hsep_plant_step_max(rate), rate, hsep_number(number, h, HSEP_REAL));
    } else {
        return HSEP_OK;
    }
    return HSEP_REFUSED;
}

HSEP_API hsep_status hsep_drive_check_start(double x_d, char message[])
{
    return hsep_check_position("the start value of x_d", x_d, "", 0.0, message);
}

HSEP_API double hsep_drive_first_measurement(double noise_std, double seed, double x)
{
    if (!(noise_std >= 0.0 && isfinite(noise_std) && seed >= 0.0 && seed <= drive_seed_max)) {
        return x;
    }
    hsep_encoder encoder;
    hsep_encoder_init(&encoder, noise_std, (uint64_t)seed);
    const double measured = hsep_encoder_measure(&encoder, x);
    return isfinite(measured) ? measured : x;
}

HSEP_API hsep_status hsep_drive_overflowed(double x, double x_d, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    hsep_message_add(
        message, "the drive's state overflowed (x = %s, command %g m)", hsep_number(number, x, HSEP_REAL), x_d);
    return HSEP_REFUSED;
}

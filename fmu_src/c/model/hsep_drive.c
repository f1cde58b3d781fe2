#include "hsep_drive.h"

#include "hsep_check.h"

#include <math.h>

static const double drive_seed_max = 2147483647.0;

HSEP_API hsep_status hsep_drive_check(double x_d, double t, double h, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    if (!isfinite(x_d)) {
        hsep_message_add(message, "x_d must be finite, got %s at t = %g s", hsep_number(number, x_d, HSEP_REAL), t);
    } else if (!isfinite(t)) {
        hsep_message_add(
            message, "the communication point must be finite, got %s s", hsep_number(number, t, HSEP_REAL));
    } else {
        return hsep_check_step_size(h, message);
    }
    return HSEP_REFUSED;
}

HSEP_API hsep_status hsep_drive_check_start(double x_d, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    if (isfinite(x_d)) {
        return HSEP_OK;
    }
    hsep_message_add(message, "the start value of x_d must be finite, got %s", hsep_number(number, x_d, HSEP_REAL));
    return HSEP_REFUSED;
}

HSEP_API double hsep_drive_first_measurement(double noise_std, double seed, double x)
{
    if (!(noise_std >= 0.0 && isfinite(noise_std) && seed >= 0.0 && seed <= drive_seed_max)) {
        return x;
    }
    hsep_encoder encoder;
    hsep_encoder_init(&encoder, noise_std, (uint64_t)seed);
    return hsep_encoder_measure(&encoder, x);
}

HSEP_API hsep_status hsep_drive_lost(double x, double x_d, char message[])
{
    char number[HSEP_NUMBER_SIZE];
    hsep_message_add(
        message, "the drive's state left the range of numbers (x = %s, command %g m)",
        hsep_number(number, x, HSEP_REAL), x_d);
    return HSEP_REFUSED;
}

/* Checks and measured output, shared by the models of the drives. */
#ifndef HSEP_DRIVE_H
#define HSEP_DRIVE_H

#include "hsep_api.h"
#include "hsep_encoder.h"
#include "hsep_model.h"

/* Check the command x_d, m, and the step from t by h, s, of a drive whose fastest rate is that, 1/s; a step is at most
 * 100 s and hsep_plant_step_max long, which bounds its cost. */
HSEP_API hsep_status hsep_drive_check(double x_d, double t, double h, double rate, char message[]);

/* Check the start value of the command. */
HSEP_API hsep_status hsep_drive_check_start(double x_d, char message[]);

/* The first measurement of a drive at rest at x, m; x itself if noise_std or seed is out of range. */
HSEP_API double hsep_drive_first_measurement(double noise_std, double seed, double x);

/* Refuse a step in which the state overflowed, at the position x, m. */
HSEP_API hsep_status hsep_drive_overflowed(double x, double x_d, char message[]);

#endif

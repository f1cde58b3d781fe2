/* Interface between model_drive.c and the two drives, the nonlinear one of eq. (13) and the stage. One of them is
 * compiled into an FMU, so the functions are bound at compile time. */
#ifndef HSEP_DRIVE_H
#define HSEP_DRIVE_H

#include "hsep_api.h"
#include "hsep_fmu.h"
#include "hsep_model.h"
#include "hsep_plant.h"

#if defined(HSEP_MODEL_FEED_DRIVE)

#define HSEP_DRIVE(function) hsep_feed_drive_##function
typedef hsep_feed_drive hsep_drive;

#elif defined(HSEP_MODEL_STAGE_DRIVE)

#define HSEP_DRIVE(function) hsep_stage_##function
typedef hsep_stage hsep_drive;

#endif

#if defined(HSEP_DRIVE)

/* Check the parameters of this drive together, after each alone; *bytes: of its block, counted in double. */
HSEP_API hsep_status
hsep_drive_check(const hsep_context *context, const double values[], double *bytes, char message[]);

/* Reset the drive, of these parameters, to rest at the start value of x_d. */
HSEP_API void hsep_drive_begin(const hsep_context *context, hsep_drive *self, const double values[]);

/* Advance by h, s, with the command x_d, m, held. Fails, with the state unchanged, if the state overflows. */
HSEP_API hsep_status hsep_drive_step(hsep_drive *self, double x_d, double h, char message[]);

/* True velocity under the last step's command, m/s. */
HSEP_API double hsep_drive_velocity(const hsep_drive *self);

#endif

#endif

/* Public header of the C core, for C99 and C++11.
 *
 * The objects are blocks of memory that the caller provides, aligned for double, of the size that hsep_*_size returns:
 * plain data without pointers, so a copy of a block is a saved state, and hsep_*_valid judges bytes from elsewhere.
 *
 * Real-time contract. All functions are reentrant: threads may use different blocks at once, one block is used by one
 * thread at a time. None allocates, locks, or throws; none but those of hsep_model.h that say so touch a file.
 * Parameters must be in the ranges given at their structs, which hsep_model_size checks; arguments must be finite.
 *
 *   function                          | bounded cost                                    | what may fail
 *   hsep_*_size                       | constant                                        | nothing
 *   hsep_*_init                       | the block's size, and the modes' exponentials   | nothing
 *   hsep_*_valid                      | constant; the predictor's, its windows          | returns 0 if invalid
 *   hsep_predictor_sample             | hsep_regression_fold; at a window's end         | divergence is set, latched
 *                                     | Np (p + q) + n^2 / 2 on top; with trust, then   |
 *                                     | alone, for each expert Np n^2, n^3 / 3 and      |
 *                                     | Np n^2 / 2; 6 Np tanh; one more in a warm run;  |
 *                                     | in a compensator preview for all Np but folds   |
 *   hsep_compensator_begin            | a window's end                                  | divergence is set, latched
 *   hsep_compensator_sample           | as the predictor's; at a window's end a plan,   | divergence is set, latched
 *                                     | m^3 / 6; hsep_interior_step after a bounded one |
 *                                     | or, with trust, hsep_trusted_planner_advance    |
 *   hsep_compensator_change           | constant; 10 spacing at the next window's end   | nothing
 *   hsep_*_read                       | constant                                        | nothing
 *   hsep_regression_fold              | n^2 / 2 times 7 operations, 2 n divisions       | nothing
 *   hsep_regression_solve             | n^2 / 2                                         | nothing
 *   hsep_regression_load              | n divisions a row                               | returns 0 for no factor
 *   hsep_physics_forced_response      | 9 a mode and sample                             | nothing
 *   hsep_discretise                   | 2 000, 64 a doubling of the norm                | nothing
 *   hsep_feed_drive_step, _stage_step | 4 slopes an internal step, at most 10^6 of them | returns 0, state unchanged
 *   hsep_encoder_measure              | constant                                        | nothing
 *   hsep_trajectory_position          | constant                                        | nothing
 *   hsep_clock_init, _count           | constant                                        | returns 0 for a wrong time
 *   hsep_model_*                      | see hsep_model.h                                | HSEP_REFUSED, with a message
 *
 * Costs are multiply-adds; n: features, m: splines in a plan. The exact ones stand at each function.
 */
#ifndef HSEP_H
#define HSEP_H

/* The C library's headers come first: they are not for the linkage below. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "hsep_clock.h"
#include "hsep_compensator.h"
#include "hsep_encoder.h"
#include "hsep_model.h"
#include "hsep_physics.h"
#include "hsep_plant.h"
#include "hsep_predictor.h"
#include "hsep_range.h"
#include "hsep_regression.h"
#include "hsep_trajectory.h"

#ifdef __cplusplus
}
#endif

#endif

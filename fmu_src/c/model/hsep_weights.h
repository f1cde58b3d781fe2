/* What was learned before the simulation.
 *
 * The resource weights.bin, little-endian, 8 bytes each: "HSEPWGT2"; p, q, input_hold, dead_time, the number of modes
 * and that of the learned samples as uint64; lambda, T_s and v_friction as doubles; f_n, zeta, alpha and beta of each mode;
 * the upper triangle of the factor [R z; 0 rho] by rows, (n + 1)(n + 2)/2 doubles for the n features of
 * hsep_features.h; the CRC-32 of all before as uint64. These are all settings that shape the features and the factor.
 */
#ifndef HSEP_WEIGHTS_H
#define HSEP_WEIGHTS_H

#include "hsep_api.h"
#include "hsep_model.h"
#include "hsep_predictor.h"
#include "hsep_regression.h"

/* Take over the factor that the resources hold, if they do. Fails if it is damaged, or was learned with other settings,
 * each of which is named. */
HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const hsep_predictor_parameters *settings, hsep_regression *regression,
    char message[]);

#endif

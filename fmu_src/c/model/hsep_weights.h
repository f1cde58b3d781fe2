/* Warm start from weights that were learned before the simulation.
 *
 * The resource weights.bin, little-endian: "HSEPWGT3"; the numbers of settings, of modes and of learned samples as
 * uint64; each setting that shapes the features and the factor, its name in 24 bytes and its value as a double; the
 * upper triangle of the factor [R z; 0 rho] by rows, (n + 1)(n + 2)/2 doubles for the n features of hsep_features.h;
 * the CRC-32 of all before as uint64.
 */
#ifndef HSEP_WEIGHTS_H
#define HSEP_WEIGHTS_H

#include "hsep_api.h"
#include "hsep_model.h"
#include "hsep_regression.h"

/* Take over the factor that the resources hold, if they do. Fails if it is damaged, or was learned with other settings,
 * each of which is named. */
HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const double values[], uint64_t n_modes, hsep_regression *regression, char message[]);

#endif

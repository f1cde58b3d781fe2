/* Warm start from weights that were learned before the simulation.
 *
 * The resource weights.bin, little-endian: "HSEPWG14"; the numbers of settings, of modes and of what has been learned
 * besides the factors, as uint64; each setting that shapes the features and the factors, its name in 24 bytes and its
 * value as a double; as doubles the numbers of hsep_residual_learned, and of hsep_uncertainty from theta on; for each
 * factor [R z; 0 rho] of hsep_residual_load its weighted number of rows and its upper triangle by rows,
 * (n + 1)(n + 2)/2 doubles for n features; the CRC-32 of all before as uint64.
 */
#ifndef HSEP_WEIGHTS_H
#define HSEP_WEIGHTS_H

#include "hsep_api.h"
#include "hsep_model.h"
#include "hsep_predictor.h"

/* Take over what the context has in memory or, where it has nothing there, the resources, if they do. Fails if it is
 * damaged, or was learned with other settings, each of which is named. */
HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const double values[], uint64_t n_modes, hsep_predictor *predictor, char message[]);

#endif

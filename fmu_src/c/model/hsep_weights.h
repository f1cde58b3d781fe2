/* What was learned before the simulation.
 *
 * The resource weights.bin holds "HSEPWGT1", p, q and the number of learned samples as uint64, then the upper triangle
 * of the factor [R z; 0 rho] by rows, (n + 1)(n + 2)/2 doubles, all little-endian; n = 2 + q + p, and HSEP_SCHEDULED
 * more if it was learned with features of the reference. lambda is part of that factor; its parameter has no effect
 * then. v_s is not told by the file: keep it as it was learned.
 */
#ifndef HSEP_WEIGHTS_H
#define HSEP_WEIGHTS_H

#include "hsep_api.h"
#include "hsep_model.h"
#include "hsep_regression.h"

/* Take over the factor that the resources hold, if they do. Fails if it was learned with another p or q, with or
 * without features of the reference where it is the other way now, or is damaged. */
HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, uint64_t p, uint64_t q, hsep_regression *regression, char message[]);

#endif

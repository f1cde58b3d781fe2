/* Convex blend of candidate predictions, weighted by their errors in the windows so far.
 *
 * Weights pi >= 0, sum pi <= 1; the rest is the prediction 0, the physics model's. They minimise the squared error of
 * the blend over the windows so far, forgotten as more was learned, with a ridge about what they are without evidence,
 * that fades. Plain data; reentrant.
 */
#ifndef HSEP_BLEND_H
#define HSEP_BLEND_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_N_BLENDED 4 /* the last residual held, and the learned candidates */

typedef struct {
    double gram[HSEP_N_BLENDED * HSEP_N_BLENDED]; /* m2 */
    double cross[HSEP_N_BLENDED];                 /* m2 */
    double weights[HSEP_N_BLENDED];
} hsep_blend;

HSEP_ASSERT_WORDS(hsep_blend, 24);

HSEP_API void hsep_blend_init(hsep_blend *self);

/* Update the weights with a measured window. products: (HSEP_N_BLENDED + 1,) by as many, m2: the scalar products over
 * it of the candidates' predictions and, last, of what was measured; scale: the largest mean square of a window, m2; n:
 * samples; n_rows: rows learned so far. */
HSEP_API void hsep_blend_update(
    hsep_blend *self, double products[HSEP_N_BLENDED + 1][HSEP_N_BLENDED + 1], double scale, uint64_t n, double n_rows);

#endif

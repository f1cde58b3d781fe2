/* Layout of the features phi and of the weights w, eq. (5), as slices of both:
 *
 *   phi(k) = [1 | x_pb(k) ... x_pb(k-q) | e_pb(k-1) ... e_pb(k-p)]
 */
#ifndef HSEP_FEATURES_H
#define HSEP_FEATURES_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_real.h"

#define HSEP_BIAS 0 /* place of the constant feature */

typedef struct {
    hsep_word p, q; /* lags of e_pb and of x_pb */
    hsep_word x;    /* place of x_pb(k), the first of q + 1 */
    hsep_word e;    /* of e_pb(k-1), the first of p */
    hsep_word n;    /* features; in a row their target's place */
} hsep_features;

HSEP_ASSERT_WORDS(hsep_features, 5);

/* Lay out p lags of e_pb and q of x_pb. */
HSEP_API void hsep_features_lay_out(hsep_features *self, hsep_word p, hsep_word q);

#endif

/* Free run of the learned ARX recursion, sample by sample; eq. (4):
 *   e(k) = bias + sum_i w_x,i x(k-i) + sum_i w_e,i e(k-i)
 *
 * Signals are kept newest first: sample k of n is at place n - 1 - k, its lag i at i places further. Reentrant.
 */
#ifndef HSEP_RECURSION_H
#define HSEP_RECURSION_H

#include "hsep_api.h"

#include <stdint.h>

typedef struct {
    const double *w_x; /* (q + 1,), lags 0 ... q */
    const double *w_e; /* (p,), lags 1 ... p */
    uint64_t p, q;
    double bias; /* m */
} hsep_recursion;

/* Run over the samples first ... last - 1 of n. x: (n + q,), e: (n + p,), m; both hold the past behind the window.
 * Cost: p + q + 1 multiply-adds a sample. */
HSEP_API void hsep_recursion_run(
    const hsep_recursion *self, const double x[], double e[], uint64_t n, uint64_t first, uint64_t last);

/* Whether all roots of z^p - w_e,1 z^(p-1) - ... - w_e,p are inside the unit circle: the Schur-Cohn test by step-down
 * recursion (Jury 1964). work: (2 p,). Cost: p^2 / 2 multiply-adds and p divisions. */
HSEP_API int hsep_recursion_stable(const hsep_recursion *self, double work[]);

#endif

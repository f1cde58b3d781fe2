/* Free run of the learned ARX recursion, sample by sample; eq. (4):
 *   e(k) = bias + sum_i w_x,i x(k-i) + sum_i w_e,i e(k-i)
 *
 * Signals are kept newest first: sample k of n is at place n - 1 - k, its lag i at i places further. Reentrant.
 */
#ifndef HSEP_RECURSION_H
#define HSEP_RECURSION_H

#include "hsep_api.h"
#include "hsep_real.h"

typedef struct {
    const hsep_real *w_x; /* (q + 1,), lags 0 ... q */
    const hsep_real *w_e; /* (p,), lags 1 ... p */
    hsep_word p, q;
    hsep_real bias; /* m */
} hsep_recursion;

/* Run over the samples first ... last - 1 of n. x: (n + q,), e: (n + p,), m; both hold the past behind the window.
 * Cost: p + q + 1 multiply-adds a sample. */
HSEP_API void hsep_recursion_run(
    const hsep_recursion *self, const hsep_real x[], hsep_real e[], hsep_word n, hsep_word first, hsep_word last);

/* Whether all roots of z^p - w_e,1 z^(p-1) - ... - w_e,p are inside the unit circle: the Schur-Cohn test by step-down
 * recursion (Jury 1964). work: (2 p,). Cost: p^2 / 2 multiply-adds and p divisions. */
HSEP_API int hsep_recursion_stable(const hsep_recursion *self, hsep_real work[]);

#endif

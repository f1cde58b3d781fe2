/* Uncertainty of a prediction: the variance of its error against the measured position, learned from earlier windows;
 * as predict/uncertainty.py, which says how and why.
 *
 * Signals are kept newest first: sample k of the n that are predicted is at place n - 1 - k. The first Np of them are
 * learned. A block as hsep_layout.h has them. Cost of a window: 50 n operations each.
 */
#ifndef HSEP_UNCERTAINTY_H
#define HSEP_UNCERTAINTY_H

#include "hsep_layout.h"
#include "hsep_predict_constants.h"

#define HSEP_N_UNCERTAINTY (2 * HSEP_UNCERTAINTY_N_COMPONENTS + 3) /* numbers that are learned, each >= 0 */

typedef struct {
    hsep_int Np;
    hsep_real theta[HSEP_UNCERTAINTY_N_COMPONENTS];    /* variance of the noise, m2; others relative to their causes */
    hsep_real evidence[HSEP_UNCERTAINTY_N_COMPONENTS]; /* effective number of windows behind each theta */
    hsep_real factor;                                  /* c in the middle of a window */
    hsep_real ratio;                                   /* c at its end relative to that at its beginning */
    hsep_real recent; /* m2, recent mean square of the residual; 0 before the first window */
    hsep_int n;       /* samples that are predicted */
    hsep_real least;  /* m, what is published at least: the largest residual, if the last ones were rejected */
    hsep_real felt[HSEP_UNCERTAINTY_N_COMPONENTS]; /* m2, components averaged over time, up to the last sample */
    /* Offsets in words from the beginning of the struct */
    hsep_int e_h;        /* (n,) m, residual of the window as published */
    hsep_int components; /* (n, HSEP_UNCERTAINTY_N_COMPONENTS) m2 but for the first, which is 1 */
    hsep_int std;        /* (n,) m, standard deviation of the error */
} hsep_uncertainty;
HSEP_ASSERT_WORDS(hsep_uncertainty, 6 + HSEP_UNCERTAINTY_N_COMPONENTS + HSEP_N_UNCERTAINTY);

HSEP_API hsep_real hsep_uncertainty_lay_out(hsep_uncertainty *self, hsep_int Np, hsep_int n);

/* Variance of the measurement noise, m2, that is assumed before the first window is measured. lambda: m2; noise_std:
 * given standard deviation, m, or 0. */
HSEP_API hsep_real hsep_uncertainty_first_variance(hsep_real lambda, hsep_real noise_std);

/* Fill the block. variance: that first one. */
HSEP_API void hsep_uncertainty_init(hsep_uncertainty *self, hsep_int Np, hsep_int n, hsep_real variance);

/* Predict the errors of samples first ... last - 1; first is 0, or where the last call ended. The first samples are at
 * least two, or n, as differences are taken. x_pb, e_h: (n,) m, physics-based prediction and predicted residual, which
 * is not published in n_physics leading samples; variance: (n,) m2, what is known of its error, or NULL. */
HSEP_API void hsep_uncertainty_predict(
    hsep_uncertainty *self, const hsep_real x_pb[], const hsep_real e_h[], const hsep_real variance[],
    hsep_int n_physics, hsep_int first, hsep_int last);

/* Learn from the measured residuals e, (Np,), m, of its first samples; accepted: (Np,), 1 where they count, or NULL for
 * all of them. */
HSEP_API void hsep_uncertainty_learn(hsep_uncertainty *self, const hsep_real e[], const hsep_real accepted[]);

#endif

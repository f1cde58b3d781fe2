/* Parameters of a predictor or compensator, and signals of a window whose residual a model predicts, and learns from.
 *
 * Signals are kept newest first: of the n samples that are predicted, late ones and a window or a preview, sample k is
 * at place n - 1 - k, and what was before them is after them; the first Np are measured when the window ends. */
#ifndef HSEP_WINDOW_H
#define HSEP_WINDOW_H

#include "hsep.h"

typedef struct {
    hsep_predictor_settings settings;
    hsep_averaging_settings averaging;
    hsep_compensator_settings compensator; /* a predictor has none */
    hsep_int preview;                      /* samples from r(k) to the drive, >= Np; a predictor's: Np */
    hsep_int horizon;       /* samples that are predicted, >= preview, in a compensator's plan; else Np */
    hsep_int n_lost;        /* samples without a measurement after which a compensator's change fades; 0: never */
    hsep_real n_init;       /* samples of warm-up from the beginning; whole, >= 0 */
    int compensates;        /* whether a compensator decides the commands of a window when it begins */
    hsep_int n_modes;       /* >= 1 */
    const hsep_mode *modes; /* (n_modes,) */
} hsep_predictor_parameters;

/* Samples of a prediction: of a window, or a compensator's plan, and before it the late ones. */
static inline hsep_int hsep_predicted(const hsep_predictor_parameters *parameters)
{
    return parameters->horizon + hsep_late(&parameters->settings);
}

#endif

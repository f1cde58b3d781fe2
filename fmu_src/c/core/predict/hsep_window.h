/* Parameters of a predictor and its models; signals of a window whose residual a model predicts, and learns from.
 *
 * Signals are kept newest first: of the n samples that are predicted, late ones and a window or a preview, sample k is at
 * place n - 1 - k, and what was before them is behind them; the first Np are measured when the window ends.
 */
#ifndef HSEP_WINDOW_H
#define HSEP_WINDOW_H

#include "hsep.h"

typedef struct {
    hsep_predictor_settings settings;
    hsep_averaging_settings averaging;
    hsep_int preview;       /* samples from r(k) to the drive, >= Np; Np alone */
    hsep_int horizon;       /* samples that are predicted, >= preview, in a compensator's plan; Np alone */
    hsep_real n_init;       /* samples of warm-up from the beginning; whole, >= 0 */
    int planned;            /* whether a compensator decides the commands of a window when it begins */
    hsep_int n_modes;       /* >= 1 */
    const hsep_mode *modes; /* (n_modes,) */
} hsep_predictor_parameters;

/* Samples of a prediction: of a window, or a compensator's plan, and before it the late ones. */
static inline hsep_int hsep_predicted(const hsep_predictor_parameters *parameters)
{
    return parameters->horizon + hsep_late(&parameters->settings);
}

typedef struct {
    const hsep_real *command; /* (n,) m, commands relative to the start */
    const hsep_real *x_pb;    /* (n + q,) m, physics-based prediction, relative to the start */
    hsep_real *e;             /* (n + p,) m, residuals as measured; alone the predictor keeps e_h at the same place */
    hsep_real *e_h;           /* (n + p,) m, residuals as predicted, behind them the measured ones */
} hsep_residual_window;

/* A sample of it whose measurement came. */
typedef struct {
    hsep_int i;             /* sample of the window, 0 ... Np - 1 */
    hsep_real relative;     /* m, measured position relative to the start */
    hsep_real command;      /* m, command that came with it, as it came, relative to the start */
    const hsep_real *x, *e; /* the window's x_pb and e from this sample on, and before it */
    int settled;            /* whether the window's commands and x_pb will not change any more */
} hsep_residual_sample;

#endif

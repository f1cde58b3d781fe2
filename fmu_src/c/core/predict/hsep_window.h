/* Signals of a window whose residual a model predicts, and that it learns from.
 *
 * They are kept newest first: of the n samples that are predicted, late ones and a window or a preview, sample k is at
 * place n - 1 - k, and what was before them is behind them; the first Np are measured when the window ends.
 */
#ifndef HSEP_WINDOW_H
#define HSEP_WINDOW_H

#include "hsep.h"

/* Parameters of a model. */
typedef struct {
    const hsep_predictor_settings *settings;
    const hsep_averaging_settings *averaging;
    const hsep_mode *modes; /* (n_modes,) */
    hsep_int n_modes;
    hsep_int n;  /* samples of a prediction: of a window, or a compensator's plan, and before it the late ones */
    int planned; /* whether a compensator decides the commands */
} hsep_residual_parameters;

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

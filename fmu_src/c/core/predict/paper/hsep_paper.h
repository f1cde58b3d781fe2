/* The paper's residual model: a ridge regression of e_pb on the features phi, eqs. (4) to (6).
 *
 * Every sample is a row, folded when it is measured. A compensator may unlearn a window whose measurement was held: the
 * regression is restored, and the residuals are replaced by their predictions. Memory is one block: the struct, then
 * its arrays as doubles; no pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_PAPER_H
#define HSEP_PAPER_H

#include "hsep_api.h"
#include "hsep_features.h"
#include "hsep_layout.h"
#include "hsep_recursion.h"
#include "hsep_regression.h"
#include "hsep_residual_window.h"
#include "hsep_sensor.h"
#include "hsep_settings.h"

#include <stdint.h>

typedef struct {
    const hsep_predictor_settings *settings;
    uint64_t preview;  /* samples from the command to the drive, >= Np */
    double v_friction; /* m/s, scale of friction's change of sign; 0: no features of the reference */
    int unlearns;      /* whether a window with a held measurement is unlearned */
} hsep_paper_parameters;

typedef struct {
    uint64_t Np, n, preview; /* n: samples of a prediction, with those that are late */
    hsep_features features;
    double sign_step; /* v_friction T_s, m */
    double x_d_last;  /* m, the commanded position before the window */
    uint64_t missing; /* whether a sample of the window is missing */
    hsep_sensor sensor;
    /* Offsets in doubles from the beginning of the struct */
    uint64_t weights; /* (n,) w */
    uint64_t signs;   /* (preview + 2 HSEP_REFERENCE_REACH,) psi of the reference, if it has features */
    uint64_t drive;   /* (preview,) m, their part of the residuals, newest first */
    uint64_t regression;
    uint64_t saved; /* the regression as it was before this window; 0: no window is unlearned */
} hsep_paper;

HSEP_ASSERT_WORDS(hsep_paper, 22);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_paper_size(const hsep_paper_parameters *parameters);

/* Fill the block, at rest at start, m, with nothing learned. */
HSEP_API void hsep_paper_init(hsep_paper *self, const hsep_paper_parameters *parameters, double start);

/* Whether a block, in any alignment, is one that hsep_paper_init with these parameters began. */
HSEP_API int hsep_paper_valid(const void *block, const hsep_paper_parameters *parameters);

HSEP_API hsep_regression *hsep_paper_regression(hsep_paper *self);

/* Take in a sample; learning: whether its window is learned. Cost: that of hsep_regression_fold. */
HSEP_API void hsep_paper_take_in(hsep_paper *self, const hsep_residual_sample *sample, int learning);

/* Finish a window; return whether all of it was measured: it is unlearned if not. */
HSEP_API int hsep_paper_finish(hsep_paper *self, const hsep_residual_window *window);

/* Begin a window: the weights, eq. (6), and the part of the features of the reference. Return whether the window before
 * it was measured: behind one that was unlearned the residuals are predicted ones. Cost: n^2 / 2 multiply-adds, the
 * tanh of hsep_reference_features_signs(preview), and a copy of the regression where windows are unlearned. */
HSEP_API int hsep_paper_begin(hsep_paper *self, const hsep_residual_window *window);

/* Predict the residuals of samples first ... last - 1; eq. (4). */
HSEP_API void hsep_paper_predict(
    const hsep_paper *self, const hsep_residual_window *window, uint64_t first, uint64_t last);

/* The learned recursion, with its bias or without. */
HSEP_API hsep_recursion hsep_paper_recursion(const hsep_paper *self, int with_bias);

/* Part of the features of the reference in the residuals of the next n samples, newest first; NULL for none. */
HSEP_API const double *hsep_paper_drive(const hsep_paper *self, uint64_t n);

#endif

/* Model of the residual e_pb = x - x_pb: the paper's (hsep_paper.h) or the averaged one (hsep_averaged_model.h); as
 * predict/predictor.py.
 *
 * The block holds one of them, and each function calls its counterpart. For a window: hsep_residual_begin; _predict,
 * which may go on in parts while _take_in takes its samples; _finish. A compensator plans with what hsep_residual_paper
 * or _averaged gives. A block as hsep_layout.h has them.
 */
#ifndef HSEP_RESIDUAL_MODEL_H
#define HSEP_RESIDUAL_MODEL_H

#include "hsep_paper.h"
#include "hsep_averaged_model.h"

typedef struct {
    hsep_int Np, late, n; /* samples of a window, late samples before it, both */
    hsep_int planned;     /* whether a compensator decides the commands */
    hsep_int learning;    /* whether the window is learned */
    /* Offsets in words from the beginning of the struct; one of them is 0 */
    hsep_int paper, averaged;
} hsep_residual_model;

HSEP_ASSERT_WORDS(hsep_residual_model, 7);

HSEP_API hsep_real hsep_residual_lay_out(hsep_residual_model *self, const hsep_predictor_parameters *parameters);
/* Fill the block, which is 0, at rest at start, m, with nothing learned. */
HSEP_API void hsep_residual_init(
    hsep_residual_model *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* The implementation; NULL if it is the other one. */
static inline hsep_paper *hsep_residual_paper(hsep_residual_model *self)
{
    return self->paper ? hsep_part(self, self->paper) : NULL;
}
static inline hsep_averaged *hsep_residual_averaged(hsep_residual_model *self)
{
    return self->averaged ? hsep_part(self, self->averaged) : NULL;
}

/* Factors [R z; 0 rho] that are learned, for a warm start before the first sample: their number, and the features of
 * one of them. The first one has the rows of the physics model's residual. */
static inline hsep_int hsep_residual_n_factors(const hsep_residual_model *self)
{
    return self->averaged ? HSEP_N_RESIDUALS : 1;
}
HSEP_API hsep_int hsep_residual_n_features(hsep_residual_model *self, hsep_int factor);

/* Where row i of a factor goes, its entries i ... n, and take it over. n_rows: rows that the
 * factor is from, weighted. */
HSEP_API hsep_real *hsep_residual_factor_row(hsep_residual_model *self, hsep_int factor);
HSEP_API void hsep_residual_load(hsep_residual_model *self, hsep_int factor, hsep_int i, hsep_real n_rows);

/* Write a factor of all that was learned, of this run and earlier ones, a triangle of n + 1 rows; return the rows that
 * it is from, weighted. Cost: with averaging n^3 / 6 multiply-adds. */
HSEP_API hsep_real hsep_residual_factor(hsep_residual_model *self, hsep_int factor, hsep_real triangle[]);

/* Numbers learned besides them, the first of so many; none without averaging. */
HSEP_API hsep_int hsep_residual_n_learned(hsep_residual_model *self);
HSEP_API hsep_real *hsep_residual_learned(hsep_residual_model *self);

/* Begin a run with what an earlier one has learned, once it is loaded into a fresh block. */
HSEP_API void hsep_residual_restart(hsep_residual_model *self);

/* Begin a window whose residuals before it are known. learning: whether it is learned. */
HSEP_API void hsep_residual_begin(hsep_residual_model *self, int learning);

/* Number of samples to predict next, given how many of the window are done. Constant cost. */
HSEP_API hsep_int hsep_residual_part(const hsep_residual_model *self, hsep_int predicted);

/* Predict the residuals of samples first ... last - 1; first is 0, or where the last call ended. */
HSEP_API void hsep_residual_predict(
    hsep_residual_model *self, const hsep_residual_window *window, hsep_int first, hsep_int last);

/* What the model knows of the errors of a predicted window, (n,) m2, newest first; NULL: nothing. */
static inline const hsep_real *hsep_residual_variance(hsep_residual_model *self)
{
    hsep_averaged *averaged = hsep_residual_averaged(self);
    return averaged != NULL ? hsep_at(averaged, averaged->variance) + (averaged->n - self->n) : NULL;
}

/* Take in a sample of the window. */
HSEP_API void hsep_residual_take_in(
    hsep_residual_model *self, const hsep_residual_window *window, const hsep_residual_sample *sample);

/* Finish a window: learn what was not learned sample by sample; window->e becomes its residuals as they are to be
 * continued from. Return whether it was learned. A first fill that was predicted is not, but is what comes before. */
HSEP_API int hsep_residual_finish(hsep_residual_model *self, const hsep_residual_window *window);

/* Samples of a finished window that count, (Np,) newest first, 1 or 0; NULL: all. */
static inline const hsep_real *hsep_residual_accepted(hsep_residual_model *self)
{
    hsep_averaged *averaged = hsep_residual_averaged(self);
    return averaged != NULL ? hsep_at(averaged, averaged->accepted) : NULL;
}

/* Measurements of this run that were missing or not plausible. */
static inline hsep_int hsep_residual_n_rejected(const hsep_residual_model *self)
{
    return self->averaged ? ((const hsep_averaged *)hsep_part_const(self, self->averaged))->n_rejected : 0;
}

#endif

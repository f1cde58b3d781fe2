#include "hsep_paper.h"

#include <string.h>

HSEP_API hsep_regression *hsep_paper_regression(hsep_paper *self)
{
    return (hsep_regression *)hsep_at(self, self->regression);
}

/* Set what follows from the settings; return the bytes of the block. */
static hsep_real paper_lay_out(hsep_paper *self, const hsep_predictor_settings *settings)
{
    hsep_real end = HSEP_WORDS(hsep_paper);
    hsep_features_lay_out(&self->features, settings->p, settings->q);
    self->n = settings->Np + settings->measurement_delay;
    self->weights = hsep_take(&end, (hsep_real)self->features.n);
    self->regression = hsep_take_block(&end, hsep_regression_size(self->features.n));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_paper_size(const hsep_predictor_settings *settings)
{
    return paper_lay_out(&(hsep_paper){0}, settings);
}

HSEP_API void hsep_paper_init(hsep_paper *self, const hsep_predictor_settings *settings)
{
    memset(self, 0, (size_t)hsep_paper_size(settings));
    (void)paper_lay_out(self, settings);
    hsep_regression_init(hsep_paper_regression(self), self->features.n, settings->lambda);
}

HSEP_API int hsep_paper_valid(const void *block, const hsep_predictor_settings *settings)
{
    hsep_paper got;
    memcpy(&got, block, sizeof got);
    (void)paper_lay_out(&got, settings); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 &&
           hsep_regression_valid(hsep_at_bytes(block, got.regression), got.features.n);
}

HSEP_API hsep_recursion hsep_paper_recursion(const hsep_paper *self, int with_bias)
{
    const hsep_features *f = &self->features;
    const hsep_real *w = hsep_at_const(self, self->weights);
    return (hsep_recursion){
        .w_x = w + f->x, .w_e = w + f->e, .p = f->p, .q = f->q, .bias = with_bias ? w[HSEP_BIAS] : 0.0};
}

HSEP_API void hsep_paper_learn(hsep_paper *self, const hsep_residual_sample *sample)
{
    const hsep_features *f = &self->features;
    hsep_real *row = hsep_regression_row(hsep_paper_regression(self)); /* phi(k), its target e_pb(k) behind it */
    row[HSEP_BIAS] = 1.0;
    memcpy(row + f->x, sample->x, (size_t)(f->q + 1) * sizeof(hsep_real));
    memcpy(row + f->e, sample->e + 1, (size_t)f->p * sizeof(hsep_real));
    row[f->n] = sample->e[0];
    hsep_regression_fold(hsep_paper_regression(self));
}

HSEP_API void hsep_paper_begin(hsep_paper *self)
{
    hsep_regression_solve(hsep_paper_regression(self), hsep_at(self, self->weights));
}

HSEP_API void hsep_paper_predict(
    const hsep_paper *self, const hsep_residual_window *window, hsep_word first, hsep_word last)
{
    const hsep_recursion recursion = hsep_paper_recursion(self, 1);
    hsep_recursion_run(&recursion, window->x_pb, window->e_h, self->n, first, last); /* Eq. (4) */
}

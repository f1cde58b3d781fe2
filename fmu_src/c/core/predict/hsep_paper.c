#include "hsep_paper.h"

HSEP_API hsep_real hsep_paper_lay_out(hsep_paper *self, const hsep_predictor_settings *settings)
{
    hsep_real end = HSEP_WORDS(hsep_paper);
    self->p = settings->p;
    self->q = settings->q;
    self->features = 2 + settings->q + settings->p;
    self->weights = hsep_take(&end, (hsep_real)self->features);
    self->regression = hsep_take_block(&end, hsep_regression_size(self->features));
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_paper_init(hsep_paper *self, const hsep_predictor_settings *settings)
{
    (void)hsep_paper_lay_out(self, settings);
    hsep_regression_init(hsep_paper_regression(self), self->features, settings->lambda);
}

HSEP_API hsep_recursion hsep_paper_recursion(const hsep_paper *self, int with_bias)
{
    const hsep_real *w = hsep_at_const(self, self->weights), *w_x = w + 1;
    return (hsep_recursion){
        .w_x = w_x, .w_e = w_x + (self->q + 1), .p = self->p, .q = self->q, .bias = with_bias ? w[0] : 0.0};
}

HSEP_API void hsep_paper_learn(hsep_paper *self, const hsep_real x[], const hsep_real e[])
{
    hsep_real *row = hsep_regression_row(hsep_paper_regression(self)), *lags = row + 2 + self->q;
    row[0] = 1.0;
    memcpy(row + 1, x, (size_t)(self->q + 1) * sizeof(hsep_real));
    memcpy(lags, e + 1, (size_t)self->p * sizeof(hsep_real));
    row[self->features] = e[0]; /* its target e_pb(k) */
    hsep_regression_fold(hsep_paper_regression(self));
}

HSEP_API void hsep_recursion_run(
    const hsep_recursion *self, const hsep_real x[], hsep_real e[], hsep_int n, hsep_int first, hsep_int last)
{
    for (hsep_int k = first; k < last; k++) {
        const hsep_int j = n - 1 - k;
        e[j] = self->bias + hsep_dot(self->w_x, x + j, self->q + 1) + hsep_dot(self->w_e, e + j + 1, self->p);
    }
}

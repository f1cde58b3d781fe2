#include "hsep_residual_model.h"

#include "hsep_cholesky.h"

#include <float.h>

#ifdef HSEP_FLOAT32
#define RESIDUAL_ROUNDING FLT_EPSILON
#else
#define RESIDUAL_ROUNDING DBL_EPSILON
#endif

/* Parts in which the averaged model predicts a window behind its first sample, as variances are dear. */
static const hsep_int residual_parts = 25;

HSEP_API hsep_real hsep_residual_lay_out(hsep_residual_model *self, const hsep_predictor_parameters *parameters)
{
    hsep_real end = HSEP_WORDS(hsep_residual_model);
    self->Np = parameters->settings.Np;
    self->late = hsep_late(&parameters->settings);
    self->n = self->Np + self->late;
    self->planned = parameters->planned != 0;
    if (parameters->averaging.averaging) {
        self->averaged = hsep_take_block(&end, hsep_averaged_lay_out(&(hsep_averaged){0}, parameters));
    } else {
        self->paper = hsep_take_block(&end, hsep_paper_lay_out(&(hsep_paper){0}, &parameters->settings));
    }
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_residual_init(
    hsep_residual_model *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    (void)hsep_residual_lay_out(self, parameters);
    if (self->averaged) {
        hsep_averaged_init(hsep_residual_averaged(self), parameters, start);
    } else {
        hsep_paper_init(hsep_residual_paper(self), &parameters->settings);
    }
}

/* Gram matrix of a factor of the averaged model. */
static hsep_gram *residual_gram(hsep_residual_model *self, hsep_int factor)
{
    return hsep_warm_start_of_run(hsep_averaged_evidence(hsep_residual_averaged(self), factor));
}

HSEP_API hsep_int hsep_residual_n_features(hsep_residual_model *self, hsep_int factor)
{
    return self->averaged ? residual_gram(self, factor)->n : hsep_paper_regression(hsep_residual_paper(self))->n;
}

HSEP_API hsep_real *hsep_residual_factor_row(hsep_residual_model *self, hsep_int factor)
{
    return self->averaged ? hsep_gram_row(residual_gram(self, factor))
                          : hsep_regression_row(hsep_paper_regression(hsep_residual_paper(self)));
}

HSEP_API void hsep_residual_load(hsep_residual_model *self, hsep_int factor, hsep_int i, hsep_real n_rows)
{
    if (self->averaged) {
        hsep_gram *gram = residual_gram(self, factor);
        hsep_gram_load(gram, i);
        gram->n_rows = n_rows;
    } else {
        hsep_regression *regression = hsep_paper_regression(hsep_residual_paper(self));
        hsep_regression_load(regression, i);
        regression->n_rows = n_rows;
    }
}

HSEP_API hsep_real hsep_residual_factor(hsep_residual_model *self, hsep_int factor, hsep_real triangle[])
{
    const hsep_int width = hsep_residual_n_features(self, factor) + 1;
    if (!self->averaged) {
        hsep_regression *regression = hsep_paper_regression(hsep_residual_paper(self));
        hsep_regression_write(regression, triangle);
        return regression->n_rows;
    }
    hsep_warm_start *evidence = hsep_averaged_evidence(hsep_residual_averaged(self), factor);
    hsep_gram *of_run = hsep_warm_start_of_run(evidence), *earlier = hsep_warm_start_earlier(evidence);
    hsep_real *least = hsep_gram_row(of_run), *diagonal = triangle; /* work */
    memset(triangle, 0, (size_t)hsep_triangle(width) * sizeof(hsep_real));
    hsep_gram_add_to(of_run, triangle);
    if (earlier->n_rows > 0.0) {
        hsep_gram_add_to(earlier, triangle);
    }
    for (hsep_int i = 0; i < width; i++) { /* what rounding leaves of a pivot where rows are few or alike */
        least[i] = RESIDUAL_ROUNDING * *diagonal + HSEP_TINY(1e-40);
        diagonal += width - i;
    }
    (void)hsep_cholesky_rows(triangle, width, 0, width, least);
    return hsep_warm_start_n_rows(evidence);
}

HSEP_API hsep_int hsep_residual_n_learned(hsep_residual_model *self)
{
    return self->averaged ? HSEP_LEARNED_WORDS + hsep_residual_averaged(self)->n_static : 0;
}

HSEP_API hsep_real *hsep_residual_learned(hsep_residual_model *self)
{
    return self->averaged ? &hsep_residual_averaged(self)->learned.velocity_scale : NULL;
}

HSEP_API void hsep_residual_restart(hsep_residual_model *self)
{
    if (self->averaged) {
        hsep_averaged_restart(hsep_residual_averaged(self));
    }
}

HSEP_API void hsep_residual_begin(hsep_residual_model *self, int learning)
{
    self->learning = learning != 0;
    if (!self->averaged) { /* the weights, eq. (6) */
        hsep_paper *paper = hsep_residual_paper(self);
        hsep_regression_solve(hsep_paper_regression(paper), hsep_at(paper, paper->weights));
    }
}

HSEP_API hsep_int hsep_residual_part(const hsep_residual_model *self, hsep_int predicted)
{
    const hsep_int part = (self->Np - 1) / residual_parts + 1;
    if (!self->averaged) {
        return self->Np;
    }
    /* The first part comes with the weights; variances of the others side by side. */
    return predicted == 0 ? 1 : part > HSEP_SOLUTION_ABREAST ? part : HSEP_SOLUTION_ABREAST;
}

HSEP_API void hsep_residual_predict(
    hsep_residual_model *self, const hsep_residual_window *window, hsep_int first, hsep_int last)
{
    if (!self->averaged) {
        const hsep_recursion recursion = hsep_paper_recursion(hsep_residual_paper(self), 1);
        hsep_recursion_run(&recursion, window->x_pb, window->e_h, self->n, first, last); /* Eq. (4) */
    } else if (first == 0) {
        hsep_averaged_forecast(hsep_residual_averaged(self), window->command, window->x_pb, NULL, 0, window->e_h, last);
    } else {
        hsep_averaged_go_on(hsep_residual_averaged(self), window->x_pb, window->e_h, first, last, 1);
    }
}

HSEP_API void hsep_residual_take_in(
    hsep_residual_model *self, const hsep_residual_window *window, const hsep_residual_sample *sample)
{
    if (self->averaged) {
        hsep_averaged *averaged = hsep_residual_averaged(self);
        hsep_recall_append_command(hsep_averaged_recall(averaged), sample->command);
        hsep_at(averaged, averaged->measured)[self->Np - 1 - sample->i] = sample->relative;
        if (self->learning && sample->settled) {
            hsep_averaged_follow(
                averaged, window->command + self->late, window->x_pb + self->late, window->e + self->late,
                sample->i + 1);
        }
    } else if (self->learning) {
        hsep_paper_learn(hsep_residual_paper(self), sample);
    }
}

HSEP_API int hsep_residual_finish(hsep_residual_model *self, const hsep_residual_window *window)
{
    const hsep_int late = self->late;
    if (self->averaged && (self->learning || self->planned)) {
        hsep_averaged_learn(
            hsep_residual_averaged(self), window->command + late, window->x_pb + late, window->e + late,
            self->learning != 0);
    }
    return self->learning != 0;
}

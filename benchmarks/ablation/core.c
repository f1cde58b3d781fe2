/* Replay of two runs by a predictor, the second one with what the first one has learned. */
#include "hsep_predictor.h"
#include "hsep_math.h"

#include <stdlib.h>
#include <string.h>

/* A run: commands and measured positions, (n,), m, and what is predicted of them with its standard deviation. */
typedef struct {
    uint64_t n;
    const double *x_d, *x;
    double *x_h, *std;
} replayed_run;

/* learned: becomes the predictor behind the last whole window, size bytes; or NULL. */
static int replay_run(hsep_predictor *predictor, const replayed_run *run, hsep_predictor *learned, size_t size)
{
    const uint64_t Np = predictor->Np;
    for (uint64_t k = 0; k < run->n + Np && predictor->divergence == HSEP_CONVERGES; k++) {
        const double x_d_ahead = run->x_d[k < run->n ? k : run->n - 1];
        hsep_predictor_sample(predictor, x_d_ahead, k >= Np ? run->x[k - Np] : run->x_d[0]);
        if (k + 1 >= Np && k + 1 < run->n + Np) {
            hsep_predictor_outputs outputs;
            hsep_predictor_read(predictor, &outputs);
            run->x_h[k + 1 - Np] = outputs.x_h;
            run->std[k + 1 - Np] = outputs.x_h_std;
        }
        if (learned != NULL && k + 1 == Np + run->n / Np * Np) {
            memcpy(learned, predictor, size);
        }
    }
    return predictor->divergence == HSEP_CONVERGES;
}

/* As a warm start does it, by way of a file. */
static void replay_take_over(hsep_predictor *predictor, hsep_predictor *trained)
{
    hsep_averaged *to = hsep_predictor_averaged(predictor), *from = hsep_predictor_averaged(trained);
    if (from != NULL) {
        memcpy(&to->learned, &from->learned, (HSEP_LEARNED_WORDS + from->n_static) * sizeof(double));
    } else {
        hsep_regression *factor = hsep_paper_regression(hsep_predictor_paper(trained));
        memcpy(hsep_paper_regression(hsep_predictor_paper(predictor)), factor, (size_t)hsep_regression_size(factor->n));
    }
    for (uint64_t i = 0; from != NULL && i < HSEP_N_RESIDUALS; i++) {
        hsep_gram *gram = hsep_warm_start_of_run(hsep_averaged_evidence(from, i));
        hsep_gram *learned = hsep_warm_start_of_run(hsep_averaged_evidence(to, i));
        memcpy(learned, gram, (size_t)hsep_gram_size(gram->n));
    }
    memcpy(
        hsep_predictor_uncertainty(predictor)->theta, hsep_predictor_uncertainty(trained)->theta,
        HSEP_N_UNCERTAINTY * sizeof(double));
    if (to != NULL) {
        hsep_averaged_restart(to);
    }
}

/* Return whether both runs were predicted without divergence. */
int replay(const hsep_parameters *given, const replayed_run *first, const replayed_run *second)
{
    const uint64_t Np = given->predictor.Np;
    hsep_predictor_parameters all = {.settings = given->predictor, .averaging = given->averaging};
    const hsep_predictor_parameters *parameters = &all;
    all.preview = all.horizon = Np;
    all.n_init = (double)Np;
    all.n_modes = given->n_modes;
    all.modes = given->modes;
    const size_t size = (size_t)hsep_predictor_lay_out(&(hsep_predictor){0}, parameters);
    hsep_predictor *trained = malloc(size), *learned = malloc(size), *predictor = malloc(size);
    int sound = trained != NULL && learned != NULL && predictor != NULL;
    if (sound) {
        hsep_predictor_block_init(trained, parameters, first->x_d[0]);
        sound = replay_run(trained, first, learned, size);
    }
    if (sound && second->n > 0) {
        hsep_predictor_block_init(predictor, parameters, second->x_d[0]);
        replay_take_over(predictor, learned);
        sound = replay_run(predictor, second, NULL, 0);
    }
    free(trained);
    free(learned);
    free(predictor);
    return sound;
}

/* What the page calls of the C library: one predictor; each run has a module of its own. */
#include "hsep.h"

#include <stdlib.h>

#define PAGE(name) __attribute__((export_name(#name))) name

static hsep_predictor *predictor;

/* Room for n numbers, kept; NULL: there is none. */
double *PAGE(room)(int n) { return malloc((size_t)n * sizeof(double)); }

/* Begin at rest at start, m: one mode with gain 1. Return NULL, or the name of what is refused. */
const char *PAGE(begin)(int Np, int p, int dead_time, double T_s, double f_n, double zeta, double beta, double start)
{
    const double omega = 2.0 * 3.14159265358979323846 * f_n;
    const hsep_mode mode = {.f_n = f_n, .zeta = zeta, .alpha = omega * omega, .beta = beta};
    hsep_parameters parameters;
    hsep_defaults(&parameters);
    parameters.predictor.Np = (hsep_int)Np;
    parameters.predictor.p = (hsep_int)p;
    parameters.predictor.dead_time = (hsep_int)dead_time;
    parameters.predictor.T_s = T_s;
    parameters.n_modes = 1;
    parameters.modes = &mode;
    const size_t size = hsep_predictor_size(&parameters);
    predictor = size == 0 ? NULL : malloc(size);
    if (predictor == NULL) {
        const char *refused = hsep_predictor_refused(&parameters);
        return refused == NULL ? "the size of a window" : refused;
    }
    (void)hsep_predictor_init(predictor, &parameters, start, NULL, 0);
    return NULL;
}

/* Play samples first to last, not included, of a window at rest and a log of n rows, m; x_pb and x_h are what was
 * predicted of each row, m. Return whether the prediction converges. */
int PAGE(play)(int first, int last, int n, int Np, const double *x_d, const double *x, double *x_pb, double *x_h)
{
    hsep_predictor_outputs outputs = {.divergence = HSEP_CONVERGES};
    for (int k = first; k < last; k++) {
        (void)hsep_predictor_sample(predictor, x_d[k < n ? k : n - 1], k < Np ? x_d[0] : x[k - Np]);
        hsep_predictor_read(predictor, &outputs);
        if (k + 1 >= Np && k + 1 - Np < n) {
            x_pb[k + 1 - Np] = outputs.x_pb;
            x_h[k + 1 - Np] = outputs.x_h;
        }
    }
    return outputs.divergence == HSEP_CONVERGES;
}

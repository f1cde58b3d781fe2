#include "hsep_blend.h"

#include <math.h>
#include <string.h>

/* Bounds on the factor by which evidence fades from window to window. */
static const double blend_memory_least = 0.7, blend_memory = 0.97;

/* What that factor falls short of 1, times the windows learned from: how far a candidate erred when it knew little says
 * little of what it knows now. */
static const double blend_outdated = 1.5;

/* Evidence that the weights without evidence count for, in windows of the largest mean square error, and the windows
 * learned from which on it falls as their inverse: the candidates' own errors are then far smaller. */
static const double blend_confidence = 0.3, blend_early = 3.0;

/* Windows learned after which the weights without evidence are halfway from the first to the later ones. */
static const double blend_experienced = 15.0;

/* Weights without evidence, before anything is learned and when much is: hold, without lags, with lags, with lags and
 * rows taken as independent. The last one learns fastest where G_pb is wrong, but errs by far in the beginning. */
static const double blend_first[HSEP_N_BLENDED] = {0.0, 0.5, 0.5, 0.0};
static const double blend_later[HSEP_N_BLENDED] = {0.0, 0.0, 0.5, 0.5};

HSEP_API void hsep_blend_init(hsep_blend *self)
{
    memset(self, 0, sizeof *self);
    memcpy(self->weights, blend_first, sizeof blend_first);
}

/* Solve A [u v] = [a b] for n unknowns, A positive definite; it is used up. */
static void blend_solve(
    double A[HSEP_N_BLENDED][HSEP_N_BLENDED], double u[HSEP_N_BLENDED], double v[HSEP_N_BLENDED], int n)
{
    for (int i = 0; i < n; i++) {
        for (int r = i + 1; r < n; r++) {
            const double factor = A[r][i] / A[i][i];
            for (int c = i; c < n; c++) {
                A[r][c] -= factor * A[i][c];
            }
            u[r] -= factor * u[i];
            v[r] -= factor * v[i];
        }
    }
    for (int i = n; i-- > 0;) {
        for (int c = i + 1; c < n; c++) {
            u[i] -= A[i][c] * u[c];
            v[i] -= A[i][c] * v[c];
        }
        u[i] /= A[i][i];
        v[i] /= A[i][i];
    }
}

/* Minimise 1/2 pi' H pi - l' pi over the pi >= 0, sum pi <= 1 that are 0 outside a support of n candidates. Return the
 * minimum, or infinity if a weight would be negative. */
static double blend_try(
    double H[HSEP_N_BLENDED][HSEP_N_BLENDED], const double l[HSEP_N_BLENDED], const int support[], int n,
    double pi[HSEP_N_BLENDED])
{
    double A[HSEP_N_BLENDED][HSEP_N_BLENDED] = {{0.0}}, found[HSEP_N_BLENDED] = {0.0}, ones[HSEP_N_BLENDED] = {0.0};
    double sum = 0.0, of_ones = 0.0, cost = 0.0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            A[i][j] = H[support[i]][support[j]];
        }
        found[i] = l[support[i]];
        ones[i] = 1.0;
    }
    blend_solve(A, found, ones, n);
    for (int i = 0; i < n; i++) {
        sum += found[i];
        of_ones += ones[i];
    }
    memset(pi, 0, HSEP_N_BLENDED * sizeof *pi);
    for (int i = 0; i < n; i++) {
        found[i] -= sum > 1.0 ? (sum - 1.0) / of_ones * ones[i] : 0.0; /* then sum pi = 1 is active */
        if (!(found[i] >= 0.0)) {
            return HUGE_VAL;
        }
        pi[support[i]] = found[i];
    }
    for (int i = 0; i < HSEP_N_BLENDED; i++) {
        double row = 0.0;
        for (int j = 0; j < HSEP_N_BLENDED; j++) {
            row += H[i][j] * pi[j];
        }
        cost += (0.5 * row - l[i]) * pi[i];
    }
    return cost;
}

/* The weights by their active set: all supports are tried. */
static void blend_minimise(
    double H[HSEP_N_BLENDED][HSEP_N_BLENDED], const double l[HSEP_N_BLENDED], double weights[HSEP_N_BLENDED])
{
    double least = 0.0, tried[HSEP_N_BLENDED];
    memset(weights, 0, HSEP_N_BLENDED * sizeof *weights);
    for (unsigned set = 1; set < 1U << HSEP_N_BLENDED; set++) {
        int support[HSEP_N_BLENDED], n = 0;
        for (int i = 0; i < HSEP_N_BLENDED; i++) {
            if ((set >> i & 1U) != 0U) {
                support[n++] = i;
            }
        }
        const double cost = blend_try(H, l, support, n, tried);
        if (cost < least) {
            least = cost;
            memcpy(weights, tried, sizeof tried);
        }
    }
}

HSEP_API void hsep_blend_update(
    hsep_blend *self, double products[HSEP_N_BLENDED + 1][HSEP_N_BLENDED + 1], double scale, uint64_t n, double n_rows)
{
    const double size = (double)n, n_windows = n_rows / size;
    const double recent = 1.0 - blend_outdated / fmax(n_windows, 1.0);
    const double memory = fmin(fmax(recent, blend_memory_least), blend_memory);
    const double ridge = blend_confidence * scale * size / fmax(n_windows / blend_early, 1.0);
    const double later = n_windows / (n_windows + blend_experienced);
    double H[HSEP_N_BLENDED][HSEP_N_BLENDED], l[HSEP_N_BLENDED];
    for (int i = 0; i < HSEP_N_BLENDED; i++) {
        for (int j = 0; j < HSEP_N_BLENDED; j++) {
            double *gram = &self->gram[HSEP_N_BLENDED * i + j];
            *gram = memory * *gram + products[i][j];
            H[i][j] = *gram + (i == j ? ridge : 0.0);
        }
        self->cross[i] = memory * self->cross[i] + products[i][HSEP_N_BLENDED];
        l[i] = self->cross[i] + ridge * (blend_first[i] + later * (blend_later[i] - blend_first[i]));
    }
    if (ridge > 0.0) {
        blend_minimise(H, l, self->weights);
    }
}

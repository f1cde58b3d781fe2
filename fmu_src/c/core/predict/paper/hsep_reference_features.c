#include "hsep_reference_features.h"

#include <math.h>

static const int reference_features_shifts[HSEP_N_REFERENCE] = {-40, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 40};
static const double reference_features_scale = 1e-3; /* m: friction up to this is hardly damped by a usual lambda */

HSEP_API void hsep_reference_features_signs(
    double signs[], const double reference[], uint64_t n, double last, double step)
{
    for (uint64_t k = 0; k < n; k++) {
        signs[HSEP_REFERENCE_REACH + k] = tanh((reference[k] - last) / step);
        last = reference[k];
    }
    for (uint64_t k = 0; k < HSEP_REFERENCE_REACH; k++) {
        signs[HSEP_REFERENCE_REACH + n + k] = 0.0;
    }
}

HSEP_API void hsep_reference_features_at(const double signs[], uint64_t k, double features[HSEP_N_REFERENCE])
{
    const double *now = signs + HSEP_REFERENCE_REACH + k;
    for (int i = 0; i < HSEP_N_REFERENCE; i++) {
        features[i] = reference_features_scale * now[reference_features_shifts[i]];
    }
}

HSEP_API void hsep_reference_features_advance(double signs[], uint64_t n)
{
    for (uint64_t k = 0; k < HSEP_REFERENCE_REACH; k++) {
        signs[k] = signs[k + n];
    }
}

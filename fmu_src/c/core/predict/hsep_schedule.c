#include "hsep_schedule.h"

#include <math.h>

static const int schedule_shifts[HSEP_SCHEDULED] = {-40, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 40};
static const double schedule_scale = 1e-3; /* m: friction up to this is hardly damped by a usual lambda */

HSEP_API void hsep_schedule_signs(double signs[], const double reference[], uint64_t n, double last, double step)
{
    for (uint64_t k = 0; k < n; k++) {
        signs[HSEP_SCHEDULE_REACH + k] = tanh((reference[k] - last) / step);
        last = reference[k];
    }
    for (uint64_t k = 0; k < HSEP_SCHEDULE_REACH; k++) {
        signs[HSEP_SCHEDULE_REACH + n + k] = 0.0;
    }
}

HSEP_API void hsep_schedule_features(const double signs[], uint64_t k, double features[HSEP_SCHEDULED])
{
    const double *now = signs + HSEP_SCHEDULE_REACH + k;
    for (int i = 0; i < HSEP_SCHEDULED; i++) {
        features[i] = schedule_scale * now[schedule_shifts[i]];
    }
}

HSEP_API void hsep_schedule_next(double signs[], uint64_t n)
{
    for (uint64_t k = 0; k < HSEP_SCHEDULE_REACH; k++) {
        signs[k] = signs[k + n];
    }
}

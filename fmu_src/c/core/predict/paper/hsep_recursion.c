#include "hsep_recursion.h"

#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>

HSEP_API void hsep_recursion_run(
    const hsep_recursion *self, const double x[], double e[], uint64_t n, uint64_t first, uint64_t last)
{
    for (uint64_t k = first; k < last; k++) {
        const uint64_t j = n - 1 - k;
        e[j] = self->bias + hsep_dot(self->w_x, x + j, self->q + 1) + hsep_dot(self->w_e, e + j + 1, self->p);
    }
}

HSEP_API int hsep_recursion_stable(const hsep_recursion *self, double work[])
{
    double *a = work, *next = work + self->p;
    for (uint64_t i = 0; i < self->p; i++) {
        a[i] = -self->w_e[i];
    }
    for (uint64_t m = self->p; m-- > 0;) {
        const double reflection = a[m];
        if (!(fabs(reflection) < 1.0)) { /* NaN too */
            return 0;
        }
        /* a_i := (a_i - kappa a_(m-i)) / (1 - kappa^2) */
        const double inverse = 1.0 / ((1.0 - reflection) * (1.0 + reflection));
        for (uint64_t i = 0; i < m; i++) {
            next[i] = (a[i] - reflection * a[m - 1 - i]) * inverse;
        }
        double *swap = a;
        a = next;
        next = swap;
    }
    return 1;
}

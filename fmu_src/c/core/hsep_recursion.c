#include "hsep_recursion.h"

#include <math.h>
#include <stddef.h>

/* Four sums side by side: the processor need not wait for one addition before the next. */
static double recursion_dot(const double a[], const double b[], uint64_t n)
{
    double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
    uint64_t i = 0;
    for (; i + 4 <= n; i += 4) {
        s0 += a[i] * b[i];
        s1 += a[i + 1] * b[i + 1];
        s2 += a[i + 2] * b[i + 2];
        s3 += a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) {
        s0 += a[i] * b[i];
    }
    return (s0 + s1) + (s2 + s3);
}

void hsep_recursion_run(
    const hsep_recursion *self, const double x[], const double drive[], double e[], uint64_t n, uint64_t first,
    uint64_t last)
{
    for (uint64_t k = first; k < last; k++) {
        const uint64_t j = n - 1 - k;
        const double bias = drive != NULL ? self->bias + drive[j] : self->bias;
        e[j] = bias + recursion_dot(self->w_x, x + j, self->q + 1) + recursion_dot(self->w_e, e + j + 1, self->p);
    }
}

int hsep_recursion_stable(const hsep_recursion *self, double work[])
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

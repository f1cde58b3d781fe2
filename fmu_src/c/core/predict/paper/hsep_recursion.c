#include "hsep_recursion.h"

#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>

HSEP_API void hsep_recursion_run(
    const hsep_recursion *self, const hsep_real x[], hsep_real e[], hsep_word n, hsep_word first, hsep_word last)
{
    for (hsep_word k = first; k < last; k++) {
        const hsep_word j = n - 1 - k;
        e[j] = self->bias + hsep_dot(self->w_x, x + j, self->q + 1) + hsep_dot(self->w_e, e + j + 1, self->p);
    }
}

HSEP_API int hsep_recursion_stable(const hsep_recursion *self, hsep_real work[])
{
    hsep_real *a = work, *next = work + self->p;
    for (hsep_word i = 0; i < self->p; i++) {
        a[i] = -self->w_e[i];
    }
    for (hsep_word m = self->p; m-- > 0;) {
        const hsep_real reflection = a[m];
        if (!(hsep_fabs(reflection) < 1.0)) { /* NaN too */
            return 0;
        }
        /* a_i := (a_i - kappa a_(m-i)) / (1 - kappa^2) */
        const hsep_real inverse = 1.0 / ((1.0 - reflection) * (1.0 + reflection));
        for (hsep_word i = 0; i < m; i++) {
            next[i] = (a[i] - reflection * a[m - 1 - i]) * inverse;
        }
        hsep_real *swap = a;
        a = next;
        next = swap;
    }
    return 1;
}

#include "hsep_features.h"

HSEP_API void hsep_features_lay_out(hsep_features *self, hsep_word p, hsep_word q)
{
    self->p = p;
    self->q = q;
    self->x = HSEP_BIAS + 1;
    self->e = self->x + q + 1;
    self->n = self->e + p;
}

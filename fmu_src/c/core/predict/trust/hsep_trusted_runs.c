/* Rows that a residual model that can be trusted has learned, of this run and of earlier ones. */
#include "hsep_trusted.h"

#include "hsep_math.h"
#include "hsep_trust_constants.h"

#include <stddef.h>
#include <string.h>

HSEP_API int hsep_trusted_doubts(const hsep_trusted *self) { return self->n_earlier[HSEP_OF_PHYSICS] > 0.0; }

HSEP_API void hsep_trusted_forget(hsep_trusted *self, hsep_evidence evidence)
{
    hsep_gram *of_run = hsep_trusted_evidence(self, evidence);
    hsep_gram_init(of_run, of_run->n);
    self->n_rows[evidence] = self->n_earlier[evidence] = 0.0;
}

HSEP_API void hsep_trusted_believe_earlier(hsep_trusted *self, hsep_evidence evidence)
{
    if (self->n_earlier[evidence] > 0.0) {
        hsep_gram_add(hsep_trusted_evidence(self, evidence), hsep_trusted_earlier(self, evidence), 1.0);
        self->n_rows[evidence] += self->n_earlier[evidence];
        self->n_earlier[evidence] = 0.0;
    }
}

HSEP_API void hsep_trusted_discount(hsep_trusted *self, hsep_evidence evidence, hsep_real kept)
{
    if (kept < 1.0) {
        hsep_gram_discount(hsep_trusted_evidence(self, evidence), kept);
        hsep_gram_discount(hsep_trusted_earlier(self, evidence), kept);
        self->n_rows[evidence] *= kept;
        self->n_earlier[evidence] *= kept;
    }
}

HSEP_API void hsep_trusted_begin_run(hsep_trusted *self, hsep_evidence evidence)
{
    hsep_gram *of_run = hsep_trusted_evidence(self, evidence);
    const hsep_real most = HSEP_TRUST_CARRIED * (hsep_real)self->Np;
    hsep_trusted_believe_earlier(self, evidence);
    hsep_trusted_discount(self, evidence, most / hsep_fmax(self->n_rows[evidence], most));
    const hsep_real n_rows = self->n_rows[evidence];
    hsep_gram_settle(of_run);
    memcpy(hsep_trusted_earlier(self, evidence), of_run, (size_t)hsep_gram_size(of_run->n));
    hsep_trusted_forget(self, evidence);
    self->n_earlier[evidence] = n_rows;
}

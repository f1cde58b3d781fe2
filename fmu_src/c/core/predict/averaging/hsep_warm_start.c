#include "hsep_warm_start.h"

#include "hsep_math.h"

/* Set what follows from the number of features; return the bytes of the block. */
static hsep_real evidence_lay_out(hsep_evidence *self, hsep_word n)
{
    hsep_real end = HSEP_WORDS(hsep_evidence);
    self->of_run = hsep_take_block(&end, hsep_gram_size(n));
    self->earlier = hsep_take_block(&end, hsep_gram_size(n));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_evidence_size(hsep_word n) { return evidence_lay_out(&(hsep_evidence){0}, n); }

HSEP_API void hsep_evidence_init(hsep_evidence *self, hsep_word n)
{
    (void)evidence_lay_out(self, n);
    hsep_gram_init(hsep_evidence_of_run(self), n);
    hsep_gram_init(hsep_evidence_earlier(self), n);
}

HSEP_API int hsep_evidence_valid(const void *block, hsep_word n)
{
    hsep_evidence got;
    return HSEP_LAID_OUT(got, block, evidence_lay_out(&got, n)) &&
           hsep_gram_valid(hsep_at_bytes(block, got.of_run), n) &&
           hsep_gram_valid(hsep_at_bytes(block, got.earlier), n);
}

HSEP_API hsep_real hsep_evidence_n_rows(hsep_evidence *self)
{
    return hsep_evidence_of_run(self)->n_rows + hsep_evidence_earlier(self)->n_rows;
}

HSEP_API void hsep_evidence_forget(hsep_evidence *self)
{
    hsep_gram_init(hsep_evidence_of_run(self), hsep_evidence_of_run(self)->n);
    hsep_evidence_forget_earlier(self);
}

HSEP_API void hsep_evidence_believe_earlier(hsep_evidence *self)
{
    if (hsep_evidence_earlier(self)->n_rows > 0.0) {
        hsep_gram_add(hsep_evidence_of_run(self), hsep_evidence_earlier(self), 1.0);
        hsep_evidence_forget_earlier(self);
    }
}

HSEP_API void hsep_evidence_forget_earlier(hsep_evidence *self) { hsep_evidence_earlier(self)->n_rows = 0.0; }

HSEP_API void hsep_evidence_discount(hsep_evidence *self, hsep_real kept)
{
    if (kept < 1.0) {
        hsep_gram_discount(hsep_evidence_of_run(self), kept);
        hsep_gram_discount(hsep_evidence_earlier(self), kept);
    }
}

HSEP_API void hsep_evidence_begin_run(hsep_evidence *self, hsep_real most)
{
    hsep_gram *of_run = hsep_evidence_of_run(self);
    hsep_evidence_believe_earlier(self);
    hsep_evidence_discount(self, most / hsep_fmax(of_run->n_rows, most));
    hsep_gram_settle(of_run);
    memcpy(hsep_evidence_earlier(self), of_run, (size_t)hsep_gram_size(of_run->n));
    hsep_gram_init(of_run, of_run->n);
}

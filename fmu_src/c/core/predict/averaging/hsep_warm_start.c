#include "hsep_warm_start.h"

#include "hsep_math.h"

#include <string.h>

/* Set what follows from the number of features; return the bytes of the block. */
HSEP_API hsep_real hsep_warm_start_lay_out(hsep_warm_start *self, hsep_int n)
{
    hsep_real end = HSEP_WORDS(hsep_warm_start);
    self->of_run = hsep_take_block(&end, hsep_gram_size(n));
    self->earlier = hsep_take_block(&end, hsep_gram_size(n));
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_warm_start_init(hsep_warm_start *self, hsep_int n)
{
    (void)hsep_warm_start_lay_out(self, n);
    hsep_gram_init(hsep_warm_start_of_run(self), n);
    hsep_gram_init(hsep_warm_start_earlier(self), n);
}

HSEP_API hsep_real hsep_warm_start_n_rows(hsep_warm_start *self)
{
    return hsep_warm_start_of_run(self)->n_rows + hsep_warm_start_earlier(self)->n_rows;
}

HSEP_API void hsep_warm_start_forget(hsep_warm_start *self)
{
    hsep_gram_init(hsep_warm_start_of_run(self), hsep_warm_start_of_run(self)->n);
    hsep_warm_start_forget_earlier(self);
}

HSEP_API void hsep_warm_start_believe_earlier(hsep_warm_start *self)
{
    if (hsep_warm_start_earlier(self)->n_rows > 0.0) {
        hsep_gram_add(hsep_warm_start_of_run(self), hsep_warm_start_earlier(self), 1.0);
        hsep_warm_start_forget_earlier(self);
    }
}

HSEP_API void hsep_warm_start_forget_earlier(hsep_warm_start *self) { hsep_warm_start_earlier(self)->n_rows = 0.0; }

HSEP_API void hsep_warm_start_discount(hsep_warm_start *self, hsep_real forgetting_factor)
{
    if (forgetting_factor < 1.0) {
        hsep_gram_discount(hsep_warm_start_of_run(self), forgetting_factor);
        hsep_gram_discount(hsep_warm_start_earlier(self), forgetting_factor);
    }
}

HSEP_API void hsep_warm_start_begin_run(hsep_warm_start *self, hsep_real most)
{
    hsep_gram *of_run = hsep_warm_start_of_run(self);
    hsep_warm_start_believe_earlier(self);
    hsep_warm_start_discount(self, most / hsep_fmax(of_run->n_rows, most));
    hsep_gram_settle(of_run);
    memcpy(hsep_warm_start_earlier(self), of_run, (size_t)hsep_gram_size(of_run->n));
    hsep_gram_init(of_run, of_run->n);
}

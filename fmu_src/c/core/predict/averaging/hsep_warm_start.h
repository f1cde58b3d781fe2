/* Rows that experts have learned: of this run and, as long as they are doubted, of earlier ones apart; as
 * predict/averaging/warm_start.py. A block as hsep_layout.h has them. */
#ifndef HSEP_WARM_START_H
#define HSEP_WARM_START_H

#include "hsep_gram.h"

typedef struct {
    hsep_int of_run, earlier; /* offsets in words: Gram matrices; one whose n_rows are 0 has no rows */
} hsep_warm_start;

HSEP_ASSERT_WORDS(hsep_warm_start, 2);

/* n: features. */
HSEP_API hsep_real hsep_warm_start_lay_out(hsep_warm_start *self, hsep_int n);
HSEP_API void hsep_warm_start_init(hsep_warm_start *self, hsep_int n);

static inline hsep_gram *hsep_warm_start_of_run(hsep_warm_start *self)
{
    return (hsep_gram *)hsep_at(self, self->of_run);
}
static inline hsep_gram *hsep_warm_start_earlier(hsep_warm_start *self)
{
    return (hsep_gram *)hsep_at(self, self->earlier);
}

/* Number of all rows, weighted. */
HSEP_API hsep_real hsep_warm_start_n_rows(hsep_warm_start *self);

/* Forget all rows; go on with all of them as rows of this run; with the rows of this run alone. */
HSEP_API void hsep_warm_start_forget(hsep_warm_start *self);
HSEP_API void hsep_warm_start_believe_earlier(hsep_warm_start *self);
HSEP_API void hsep_warm_start_forget_earlier(hsep_warm_start *self);

/* Weigh all rows so far by forgetting_factor. */
HSEP_API void hsep_warm_start_discount(hsep_warm_start *self, hsep_real forgetting_factor);

/* Begin another run: all rows so far are of earlier ones, and weigh at most as many of this one. */
HSEP_API void hsep_warm_start_begin_run(hsep_warm_start *self, hsep_real most);

#endif

/* Rows that experts have learned: of this run and, as long as they are doubted, of earlier ones apart; as
 * predict/averaging/warm_start.py. A block as hsep_layout.h has them. */
#ifndef HSEP_WARM_START_H
#define HSEP_WARM_START_H

#include "hsep_gram.h"

typedef struct {
    hsep_word of_run, earlier; /* offsets in words: Gram matrices; one whose n_rows are 0 has no rows */
} hsep_evidence;

HSEP_ASSERT_WORDS(hsep_evidence, 2);

/* Bytes of the block, counted as a number so that no size can overflow; n: features. */
HSEP_API hsep_real hsep_evidence_size(hsep_word n);
HSEP_API void hsep_evidence_init(hsep_evidence *self, hsep_word n);
HSEP_API int hsep_evidence_valid(const void *block, hsep_word n);

static inline hsep_gram *hsep_evidence_of_run(hsep_evidence *self) { return (hsep_gram *)hsep_at(self, self->of_run); }
static inline hsep_gram *hsep_evidence_earlier(hsep_evidence *self)
{
    return (hsep_gram *)hsep_at(self, self->earlier);
}

/* Number of all rows, weighted. */
HSEP_API hsep_real hsep_evidence_n_rows(hsep_evidence *self);

/* Forget all rows; go on with all of them as rows of this run; with the rows of this run alone. */
HSEP_API void hsep_evidence_forget(hsep_evidence *self);
HSEP_API void hsep_evidence_believe_earlier(hsep_evidence *self);
HSEP_API void hsep_evidence_forget_earlier(hsep_evidence *self);

/* Weigh all rows so far by kept. */
HSEP_API void hsep_evidence_discount(hsep_evidence *self, hsep_real kept);

/* Begin another run: all rows so far are of earlier ones, and weigh at most as many of this one. */
HSEP_API void hsep_evidence_begin_run(hsep_evidence *self, hsep_real most);

#endif

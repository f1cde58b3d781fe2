/* Stack of experts: the convex sum of their predictions that would have erred least so far; as
 * predict/averaging/stacking.py, which has the formula. The remainder of the weights is the prediction 0, the physics
 * model's. Plain data; reentrant. */
#ifndef HSEP_STACKING_H
#define HSEP_STACKING_H

#include "hsep_layout.h"
#include "hsep_predict_constants.h"

/* Entry of the tuple of experts, as predict/averaging/experts.py has it; its place there is its place in the stack. */
typedef struct {
    hsep_real first_weight; /* without evidence */
    hsep_int target;        /* residual that a regression predicts and learns */
    hsep_int has_lags;      /* whether lags of it are among its features */
    hsep_int is_fresh;      /* whether it gives earlier runs little weight: with the target of the one that led */
} hsep_expert_entry;

static inline hsep_expert_entry hsep_expert_of(hsep_int place)
{
    static const hsep_expert_entry entries[HSEP_N_EXPERTS] = {HSEP_EXPERTS};
    return entries[place];
}

/* Weight of the rows of earlier runs for a regression. */
static inline hsep_real hsep_expert_weight(hsep_int place)
{
    return hsep_expert_of(place).is_fresh ? HSEP_AVERAGING_WARM_PRIOR_WEIGHT : 1.0;
}

typedef struct {
    hsep_real weights[HSEP_N_EXPERTS];               /* pi */
    hsep_real gram[HSEP_N_EXPERTS * HSEP_N_EXPERTS]; /* m2, F' F so far */
    hsep_real cross[HSEP_N_EXPERTS];                 /* m2, F' e so far */
    hsep_real evidence[2];                           /* e' e so far, m2, and samples */
} hsep_stack;

/* Stacks of a model: of predictions, and of a compensator's plans, by errors half a plan ahead, too. */
enum { HSEP_OF_PREDICTIONS, HSEP_OF_PLANS, HSEP_N_STACKS };

#define HSEP_STACK_WORDS (HSEP_N_EXPERTS * (HSEP_N_EXPERTS + 2) + 2)

HSEP_ASSERT_WORDS(hsep_stack, HSEP_STACK_WORDS);

/* Begin without evidence. */
HSEP_API void hsep_stack_init(hsep_stack *self);

/* Scalar products over n samples of the predictions and, last, of what was measured, m2: upper triangle. */
typedef struct {
    hsep_real of[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1];
    hsep_real n;
} hsep_stack_products;

/* Add count samples. signals: each expert's predictions and, last, what was measured, (count,), m; counts: (count,), 1,
 * or 0 where it was not; work: (count,). */
HSEP_API void hsep_stack_add(
    hsep_stack_products *self, const hsep_real *const signals[HSEP_N_EXPERTS + 1], const hsep_real counts[],
    hsep_real work[], hsep_int count);

/* Update the weights with a measured window, of one sample or more. least: least mean square that errors are judged by,
 * m2; like: (HSEP_N_EXPERTS,) weights of another stack, in place of the first weights and with more weight; or NULL.
 * Constant cost. */
HSEP_API void hsep_stack_update(
    hsep_stack *self, const hsep_stack_products *products, hsep_real least, const hsep_real like[]);

/* Weights of all experts but HSEP_RECALL, 0, with its weight shared among them and physics. */
HSEP_API void hsep_stack_others(const hsep_stack *self, hsep_real others[HSEP_N_EXPERTS]);

/* HSEP_ARX_COMMAND, if it has more weight than HSEP_ARX_RESIDUAL and HSEP_STATIC together; else HSEP_ARX_RESIDUAL. */
HSEP_API hsep_int hsep_stack_leader(const hsep_stack *self);

/* Give an expert the evidence of another, as if it had predicted the same so far. */
HSEP_API void hsep_stack_copy(hsep_stack *self, hsep_int expert, hsep_int to);

/* Forget an expert that predicts no more. */
HSEP_API void hsep_stack_forget(hsep_stack *self, hsep_int expert);

#endif

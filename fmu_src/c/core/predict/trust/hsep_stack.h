/* Stack of experts: the convex sum of their predictions that would have erred least so far.
 *
 * pi = argmin |e - F pi|^2 + kappa s^2 n |pi - pi_0|^2 over the windows so far, pi >= 0, sum pi <= 1, their evidence
 * fading by gamma a window, with the mean square s^2 of the best expert and n samples of a window: without evidence
 * pi = pi_0. The remainder of the weights is the prediction 0, the physics model's. Plain data; reentrant.
 */
#ifndef HSEP_STACK_H
#define HSEP_STACK_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_real.h"

/* Experts in the order of the stack: the last residual; static features with lags, and without; the command alone; and
 * the one of these with lags that led, with little weight of earlier runs. */
typedef enum { HSEP_HOLD = 0, HSEP_LAGGED, HSEP_STATIC, HSEP_COMMAND, HSEP_DOUBTING } hsep_expert_place;

#define HSEP_N_EXPERTS 5

typedef struct {
    hsep_real weights[HSEP_N_EXPERTS];               /* pi */
    hsep_real gram[HSEP_N_EXPERTS * HSEP_N_EXPERTS]; /* m2, F' F so far */
    hsep_real cross[HSEP_N_EXPERTS];                 /* m2, F' e so far */
    hsep_real evidence[2];                           /* e' e so far, m2, and samples */
} hsep_stack;

HSEP_ASSERT_WORDS(hsep_stack, HSEP_N_EXPERTS *(HSEP_N_EXPERTS + 2) + 2);

HSEP_API void hsep_stack_init(hsep_stack *self);

/* Update the weights with a measured window. products: (HSEP_N_EXPERTS + 1,) by as many, m2: the scalar products over
 * it of the predictions and, last, of what was measured; n: its samples, > 0; least: least mean square that errors are
 * judged by, m2. Constant cost. */
HSEP_API void hsep_stack_update(
    hsep_stack *self, hsep_real products[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1], hsep_real n, hsep_real least);

/* HSEP_COMMAND, if it has more of the weights than HSEP_LAGGED and HSEP_STATIC together, else HSEP_LAGGED. */
HSEP_API hsep_expert_place hsep_stack_leader(const hsep_stack *self);

/* Give an expert the evidence of another, as if it had predicted the same so far. */
HSEP_API void hsep_stack_copy(hsep_stack *self, hsep_expert_place expert, hsep_expert_place to);

/* Forget an expert that predicts no more. */
HSEP_API void hsep_stack_forget(hsep_stack *self, hsep_expert_place expert);

#endif

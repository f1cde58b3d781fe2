/* Stack of experts: the convex sum of their predictions that would have erred least so far; as
 * predict/averaging/stacking.py, which has the formula. The remainder of the weights is the physics model's, 0. */
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

/* Scalar products over n samples of the predictions and, last, of what was measured, m2: upper triangle. */
typedef struct {
    hsep_real of[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1];
    hsep_real n;
} hsep_stack_products;

/* Begin without evidence. */
static inline void hsep_stack_init(hsep_stack *self)
{
    memset(self, 0, sizeof *self);
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->weights[i] = hsep_expert_of(i).first_weight;
    }
}

/* Support of weights, with R' R = H on it: rows of R', z = R'^-1 l, ones = R'^-1 1; their products up to each place. */
typedef struct {
    int places[HSEP_N_EXPERTS];
    hsep_real rows[HSEP_N_EXPERTS][HSEP_N_EXPERTS], z[HSEP_N_EXPERTS], ones[HSEP_N_EXPERTS];
    hsep_real z_z[HSEP_N_EXPERTS + 1], z_ones[HSEP_N_EXPERTS + 1], ones_ones[HSEP_N_EXPERTS + 1];
} stack_support;

/* Add row n, where those before it are known; an expert that rounding does not resolve weighs nothing. */
static inline void stack_extend(
    stack_support *self, int n, hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], const hsep_real l[HSEP_N_EXPERTS])
{
    const int place = self->places[n];
    hsep_real *row = self->rows[n], pivot = H[place][place], z = l[place], one = 1.0;
    for (int i = 0; i < n; i++) {
        row[i] = H[place][self->places[i]];
        for (int j = 0; j < i; j++) {
            row[i] -= row[j] * self->rows[i][j];
        }
        row[i] /= self->rows[i][i];
        pivot -= row[i] * row[i];
        z -= row[i] * self->z[i];
        one -= row[i] * self->ones[i];
    }
    row[n] = pivot > 0.0 ? hsep_sqrt(pivot) : INFINITY;
    self->z[n] = z /= row[n];
    self->ones[n] = one /= row[n];
    self->z_z[n + 1] = self->z_z[n] + z * z;
    self->z_ones[n + 1] = self->z_ones[n] + z * one;
    self->ones_ones[n + 1] = self->ones_ones[n] + one * one;
}

/* The weights on a support of n, R w = z - multiplier ones; return whether none is negative. */
static inline int stack_weigh(const stack_support *self, int n, hsep_real multiplier, hsep_real weights[HSEP_N_EXPERTS])
{
    hsep_real found[HSEP_N_EXPERTS] = {0.0};
    for (int i = n; i-- > 0;) {
        hsep_real weight = self->z[i] - multiplier * self->ones[i];
        for (int j = i + 1; j < n; j++) {
            weight -= self->rows[j][i] * found[self->places[j]];
        }
        found[self->places[i]] = weight / self->rows[i][i];
        if (!(found[self->places[i]] >= 0.0)) {
            return 0;
        }
    }
    memcpy(weights, found, sizeof found);
    return 1;
}

/* The pi >= 0, sum pi <= 1 that minimise 1/2 pi' H pi - l' pi, by their active set: all supports are tried, each with
 * the rows of the one without its lowest place, which was tried before. On a support the minimum is -z' z / 2, and
 * (z' ones - 1)^2 / (2 ones' ones) more where the sum z' ones would exceed 1. */
static inline void stack_minimise(
    hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], const hsep_real l[HSEP_N_EXPERTS], hsep_real weights[HSEP_N_EXPERTS])
{
    stack_support support = {{0}, {{0.0}}, {0.0}, {0.0}, {0.0}, {0.0}, {0.0}};
    hsep_real least = 0.0;
    hsep_zero(weights, HSEP_N_EXPERTS);
    for (unsigned set = 1; set < 1U << HSEP_N_EXPERTS; set++) {
        int n = 0;
        for (int i = HSEP_N_EXPERTS; i-- > 0;) {
            if ((set >> i & 1U) != 0U) {
                support.places[n++] = i;
            }
        }
        stack_extend(&support, n - 1, H, l);
        const hsep_real excess = hsep_fmax(support.z_ones[n] - 1.0, 0.0);
        const hsep_real multiplier = excess / support.ones_ones[n], cost = multiplier * excess - support.z_z[n];
        if (cost < least && stack_weigh(&support, n, multiplier, weights)) {
            least = cost;
        }
    }
}

/* Add count samples. signals: predictions and, last, what was measured, (count,), m; counts: (count,), 0 where not. */
static inline void hsep_stack_add(
    hsep_stack_products *self, const hsep_real *const signals[HSEP_N_EXPERTS + 1], const hsep_real counts[],
    hsep_real work[], hsep_int count)
{
    for (hsep_int j = 0; j < count; j++) {
        self->n += counts[j];
    }
    for (hsep_int i = 0; i <= HSEP_N_EXPERTS; i++) {
        for (hsep_int j = 0; j < count; j++) {
            work[j] = counts[j] * signals[i][j];
        }
        for (hsep_int l = i; l <= HSEP_N_EXPERTS; l++) {
            self->of[i][l] += hsep_dot(work, signals[l], count);
        }
    }
}

/* Update the weights with a measured window, of one sample or more. least: least mean square that errors are judged by,
 * m2; like: (HSEP_N_EXPERTS,) weights of another stack, in place of the first weights and with more weight; or NULL. */
static inline void hsep_stack_update(
    hsep_stack *self, const hsep_stack_products *products, hsep_real least, const hsep_real like[])
{
    hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], l[HSEP_N_EXPERTS];
    const hsep_real before = self->evidence[1], left = hsep_fmax(before - HSEP_AVERAGING_RENEWAL * products->n, 0.0);
    const hsep_real gamma = hsep_fmin(HSEP_AVERAGING_GAMMA, left / hsep_fmax(before, products->n));
    self->evidence[0] = gamma * self->evidence[0] + products->of[HSEP_N_EXPERTS][HSEP_N_EXPERTS];
    self->evidence[1] = gamma * self->evidence[1] + products->n;
    hsep_real best = self->evidence[0]; /* of the prediction 0, which is always there */
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        for (hsep_int j = 0; j < HSEP_N_EXPERTS; j++) {
            hsep_real *gram = &self->gram[HSEP_N_EXPERTS * i + j];
            *gram = gamma * *gram + products->of[i < j ? i : j][i < j ? j : i];
            H[i][j] = *gram;
        }
        self->cross[i] = gamma * self->cross[i] + products->of[i][HSEP_N_EXPERTS];
        best = hsep_fmin(best, self->evidence[0] - 2.0 * self->cross[i] + H[i][i]);
    }
    const hsep_real kappa = like != NULL ? HSEP_AVERAGING_KAPPA_OF_PLANS : HSEP_AVERAGING_KAPPA;
    best = hsep_fmax(hsep_fmax(best / self->evidence[1], least), HSEP_STACKING_LEAST_SQUARE);
    const hsep_real ridge = kappa * best * products->n;
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        H[i][i] += ridge;
        l[i] = self->cross[i] + ridge * (like != NULL ? like[i] : hsep_expert_of(i).first_weight);
    }
    stack_minimise(H, l, self->weights);
}

/* Weights of all experts but HSEP_RECALL, 0, with its weight shared among them and physics. */
static inline void hsep_stack_others(const hsep_stack *self, hsep_real others[HSEP_N_EXPERTS])
{
    const hsep_real left = 1.0 - self->weights[HSEP_RECALL];
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        others[i] = left > HSEP_STACKING_ROUNDING ? self->weights[i] / left : hsep_expert_of(i).first_weight;
    }
    others[HSEP_RECALL] = 0.0;
}

/* HSEP_ARX_COMMAND, if it has more weight than HSEP_ARX_RESIDUAL and HSEP_STATIC together; else HSEP_ARX_RESIDUAL. */
static inline hsep_int hsep_stack_leader(const hsep_stack *self)
{
    const hsep_real *w = self->weights;
    return w[HSEP_ARX_COMMAND] > w[HSEP_ARX_RESIDUAL] + w[HSEP_STATIC] ? HSEP_ARX_COMMAND : HSEP_ARX_RESIDUAL;
}

/* Give an expert the evidence of another, as if it had predicted the same so far. */
static inline void hsep_stack_copy(hsep_stack *self, hsep_int expert, hsep_int to)
{
    hsep_copy(self->gram + HSEP_N_EXPERTS * to, self->gram + HSEP_N_EXPERTS * expert, HSEP_N_EXPERTS);
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->gram[HSEP_N_EXPERTS * i + to] = self->gram[HSEP_N_EXPERTS * i + expert];
    }
    self->cross[to] = self->cross[expert];
}

/* Forget an expert that predicts no more. */
static inline void hsep_stack_forget(hsep_stack *self, hsep_int expert)
{
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->gram[HSEP_N_EXPERTS * i + expert] = self->gram[HSEP_N_EXPERTS * expert + i] = 0.0;
    }
    self->cross[expert] = self->weights[expert] = 0.0;
}

#endif

#include "hsep_stacking.h"

#include "hsep_math.h"

#include <string.h>

HSEP_API void hsep_stack_init(hsep_stack *self)
{
    memset(self, 0, sizeof *self);
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->weights[i] = hsep_expert_of(i).first_weight;
    }
}

/* Solve A [u v] = [a b] for n unknowns, A positive definite; it is used up. */
static void stack_solve(
    hsep_real A[HSEP_N_EXPERTS][HSEP_N_EXPERTS], hsep_real u[HSEP_N_EXPERTS], hsep_real v[HSEP_N_EXPERTS], int n)
{
    for (int i = 0; i < n; i++) {
        for (int r = i + 1; r < n; r++) {
            const hsep_real factor = A[r][i] / A[i][i];
            for (int c = i; c < n; c++) {
                A[r][c] -= factor * A[i][c];
            }
            u[r] -= factor * u[i];
            v[r] -= factor * v[i];
        }
    }
    for (int i = n; i-- > 0;) {
        for (int c = i + 1; c < n; c++) {
            u[i] -= A[i][c] * u[c];
            v[i] -= A[i][c] * v[c];
        }
        u[i] /= A[i][i];
        v[i] /= A[i][i];
    }
}

/* Minimise 1/2 pi' H pi - l' pi over the pi >= 0, sum pi <= 1 that are 0 outside a support of n experts. Return the
 * minimum, or infinity if a weight would be negative. */
static hsep_real stack_try(
    hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], const hsep_real l[HSEP_N_EXPERTS], const int support[], int n,
    hsep_real pi[HSEP_N_EXPERTS])
{
    hsep_real A[HSEP_N_EXPERTS][HSEP_N_EXPERTS], found[HSEP_N_EXPERTS], ones[HSEP_N_EXPERTS];
    hsep_real sum = 0.0, of_ones = 0.0, cost = 0.0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            A[i][j] = H[support[i]][support[j]];
        }
        found[i] = l[support[i]];
        ones[i] = 1.0;
    }
    stack_solve(A, found, ones, n);
    for (int i = 0; i < n; i++) {
        sum += found[i];
        of_ones += ones[i];
    }
    for (int i = 0; i < n; i++) {
        found[i] -= sum > 1.0 ? (sum - 1.0) / of_ones * ones[i] : 0.0; /* then sum pi = 1 is active */
        if (!(found[i] >= 0.0)) {
            return INFINITY;
        }
    }
    for (int i = 0; i < HSEP_N_EXPERTS; i++) {
        pi[i] = 0.0;
    }
    for (int i = 0; i < n; i++) {
        pi[support[i]] = found[i];
    }
    for (int i = 0; i < n; i++) {
        hsep_real row = 0.0;
        for (int j = 0; j < n; j++) {
            row += H[support[i]][support[j]] * found[j];
        }
        cost += (0.5 * row - l[support[i]]) * found[i];
    }
    return cost;
}

/* The weights by their active set: all supports are tried. */
static void stack_minimise(
    hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], const hsep_real l[HSEP_N_EXPERTS], hsep_real weights[HSEP_N_EXPERTS])
{
    hsep_real least = 0.0, tried[HSEP_N_EXPERTS] = {0.0};
    memset(weights, 0, HSEP_N_EXPERTS * sizeof *weights);
    for (unsigned set = 1; set < 1U << HSEP_N_EXPERTS; set++) {
        int support[HSEP_N_EXPERTS], n = 0;
        for (int i = 0; i < HSEP_N_EXPERTS; i++) {
            if ((set >> i & 1U) != 0U) {
                support[n++] = i;
            }
        }
        const hsep_real cost = stack_try(H, l, support, n, tried);
        if (cost < least) {
            least = cost;
            memcpy(weights, tried, sizeof tried);
        }
    }
}

HSEP_API void hsep_stack_update(
    hsep_stack *self, hsep_real products[HSEP_N_EXPERTS + 1][HSEP_N_EXPERTS + 1], hsep_real n, hsep_real least)
{
    hsep_real H[HSEP_N_EXPERTS][HSEP_N_EXPERTS], l[HSEP_N_EXPERTS];
    self->evidence[0] = HSEP_AVERAGING_GAMMA * self->evidence[0] + products[HSEP_N_EXPERTS][HSEP_N_EXPERTS];
    self->evidence[1] = HSEP_AVERAGING_GAMMA * self->evidence[1] + n;
    hsep_real best = self->evidence[0]; /* of the prediction 0, which is always there */
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        for (hsep_int j = 0; j < HSEP_N_EXPERTS; j++) {
            hsep_real *gram = &self->gram[HSEP_N_EXPERTS * i + j];
            *gram = HSEP_AVERAGING_GAMMA * *gram + products[i][j];
            H[i][j] = *gram;
        }
        self->cross[i] = HSEP_AVERAGING_GAMMA * self->cross[i] + products[i][HSEP_N_EXPERTS];
        best = hsep_fmin(best, self->evidence[0] - 2.0 * self->cross[i] + H[i][i]);
    }
    const hsep_real square = hsep_fmax(hsep_fmax(best / self->evidence[1], least), HSEP_STACKING_LEAST_SQUARE);
    const hsep_real ridge = HSEP_AVERAGING_KAPPA * square * n;
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        H[i][i] += ridge;
        l[i] = self->cross[i] + ridge * hsep_expert_of(i).first_weight;
    }
    stack_minimise(H, l, self->weights);
}

HSEP_API void hsep_stack_others(const hsep_stack *self, hsep_real others[HSEP_N_EXPERTS])
{
    const hsep_real left = 1.0 - self->weights[HSEP_RECALL];
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        others[i] = left > HSEP_STACKING_ROUNDING ? self->weights[i] / left : hsep_expert_of(i).first_weight;
    }
    others[HSEP_RECALL] = 0.0;
}

HSEP_API hsep_int hsep_stack_leader(const hsep_stack *self)
{
    const hsep_real *weights = self->weights;
    return weights[HSEP_ARX_COMMAND] > weights[HSEP_ARX_RESIDUAL] + weights[HSEP_STATIC] ? HSEP_ARX_COMMAND
                                                                                         : HSEP_ARX_RESIDUAL;
}

HSEP_API void hsep_stack_copy(hsep_stack *self, hsep_int expert, hsep_int to)
{
    memcpy(self->gram + HSEP_N_EXPERTS * to, self->gram + HSEP_N_EXPERTS * expert, HSEP_N_EXPERTS * sizeof(hsep_real));
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->gram[HSEP_N_EXPERTS * i + to] = self->gram[HSEP_N_EXPERTS * i + expert];
    }
    self->cross[to] = self->cross[expert];
}

HSEP_API void hsep_stack_forget(hsep_stack *self, hsep_int expert)
{
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        self->gram[HSEP_N_EXPERTS * i + expert] = self->gram[HSEP_N_EXPERTS * expert + i] = 0.0;
    }
    self->cross[expert] = self->weights[expert] = 0.0;
}

#include "hsep_slacks.h"

#include "hsep_math.h"

/* Of the sides: B = A, B = -A. */
static const hsep_real slacks_sign[2] = {1.0, -1.0};

/* B x - b of a row: A x - low, or high - A x. */
static inline hsep_real slacks_distance(int i, hsep_real Ax, hsep_real b) { return i == 0 ? Ax - b : b - Ax; }

HSEP_API void hsep_slacks_begin(const hsep_slacks *self, hsep_real cost, int again)
{
    const hsep_real least = again ? HSEP_QP_SLACK_AGAIN : HSEP_QP_FIRST_SLACK;
    const hsep_real mu = (again ? HSEP_QP_MU_AGAIN : HSEP_QP_FIRST_MU) * cost;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                side->s[r] = hsep_fmax(slacks_distance(i, self->Ax[r], side->b[r]), least);
                side->z[r] = hsep_fmax(again ? side->z[r] : 0.0, mu / side->s[r]);
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
}

/* Sums or maxima of rows, four side by side, and of the rows left over, so that compilers find vectors and results are
 * the same to the last bit whatever they find. */
typedef struct {
    hsep_real of[5];
} slacks_values;

static hsep_real slacks_sum(const slacks_values *values)
{
    const hsep_real *s = values->of;
    return ((s[0] + s[1]) + (s[2] + s[3])) + s[4];
}

static hsep_real slacks_larger(hsep_real a, hsep_real b) { return a > b ? a : b; }

static hsep_real slacks_largest(const slacks_values *values)
{
    hsep_real largest = values->of[4];
    for (int i = 0; i < 4; i++) {
        largest = slacks_larger(values->of[i], largest);
    }
    return largest;
}

HSEP_API void hsep_slacks_push(const hsep_slacks *self)
{
    const hsep_side *low = &self->side[0], *high = &self->side[1];
    hsep_real *restrict work = self->work;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
            work[r] = (low->r_c[r] - low->z[r] * low->inverse[r] * low->r_p[r]) -
                      (high->r_c[r] - high->z[r] * high->inverse[r] * high->r_p[r]);
        }
    }
}

/* Steps of count rows, ds = B dx + r_p + rho dz, dz = r_c - z (B dx + r_p) / (s + rho z), and the largest -change /
 * value of slacks and multipliers. */
static inline void slacks_steps(
    const hsep_slacks *self, int i, hsep_int r, hsep_int count, slacks_values *primal, slacks_values *dual)
{
    const hsep_side *side = &self->side[i];
    const hsep_real *restrict Adx = self->Adx + r, *restrict r_p = side->r_p + r, *restrict r_c = side->r_c + r;
    const hsep_real *restrict s = side->s + r, *restrict z = side->z + r, *restrict inverse = side->inverse + r;
    hsep_real *restrict ds = side->ds + r, *restrict dz = side->dz + r;
    for (hsep_int l = 0; l < count; l++) {
        const hsep_int at = count == 4 ? l : 4;
        const hsep_real to = slacks_sign[i] * Adx[l] + r_p[l];
        dz[l] = r_c[l] - z[l] * inverse[l] * to;
        ds[l] = to + self->rho * dz[l];
        primal->of[at] = slacks_larger(-ds[l] / s[l], primal->of[at]);
        dual->of[at] = slacks_larger(-dz[l] / z[l], dual->of[at]);
    }
}

/* Steps ds and dz, and their lengths to where all values + length change stay >= 0: the largest -change / value is its
 * inverse. */
static hsep_lengths slacks_lengths(const hsep_slacks *self)
{
    slacks_values primal = {{0.0}}, dual = {{0.0}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_steps(self, i, r, 4, &primal, &dual);
            }
            slacks_steps(self, i, r, self->range[order].end - r, &primal, &dual);
        }
    }
    const hsep_real of_s = slacks_largest(&primal), of_z = slacks_largest(&dual);
    return (hsep_lengths){.primal = of_s > 1.0 ? 1.0 / of_s : 1.0, .dual = of_z > 1.0 ? 1.0 / of_z : 1.0};
}

/* Residuals of count rows: the sum of s z, the largest primal residual, and the bound that is exceeded most. */
static inline void slacks_residuals(
    const hsep_slacks *self, int i, hsep_int r, hsep_int count, slacks_values *sum, slacks_values *largest,
    slacks_values *outside)
{
    const hsep_side *side = &self->side[i];
    const hsep_real *restrict Ax = self->Ax + r, *restrict b = side->b + r, *restrict s = side->s + r;
    const hsep_real *restrict z = side->z + r, *restrict inverse = side->inverse + r;
    hsep_real *restrict r_p = side->r_p + r, *restrict r_c = side->r_c + r;
    hsep_real *restrict Adx = self->Adx + r, *restrict work = self->work + r;
    for (hsep_int l = 0; l < count; l++) {
        const hsep_int at = count == 4 ? l : 4;
        const hsep_real product = s[l] * z[l], weight = z[l] * inverse[l], distance = slacks_sign[i] * (Ax[l] - b[l]);
        r_p[l] = distance - s[l];
        r_c[l] = -product * inverse[l];
        sum->of[at] += product;
        largest->of[at] = slacks_larger(slacks_larger(r_p[l], -r_p[l]), largest->of[at]);
        outside->of[at] = slacks_larger(-distance, outside->of[at]);
        Adx[l] = i == 0 ? weight : Adx[l] + weight;
        work[l] = i == 0 ? z[l] : work[l] - z[l];
    }
}

HSEP_API hsep_real hsep_slacks_residuals(const hsep_slacks *self, hsep_real *primal, hsep_real *beyond)
{
    slacks_values sum = {{0.0}}, largest = {{0.0}};
    slacks_values outside = {{-INFINITY, -INFINITY, -INFINITY, -INFINITY, -INFINITY}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_residuals(self, i, r, 4, &sum, &largest, &outside);
            }
            slacks_residuals(self, i, r, self->range[order].end - r, &sum, &largest, &outside);
        }
    }
    *primal = slacks_largest(&largest);
    *beyond = slacks_largest(&outside);
    return slacks_sum(&sum) / self->sides;
}

/* Sum of s z of count rows after a step. */
static inline void slacks_after(
    const hsep_side *side, const hsep_lengths *alpha, hsep_int r, hsep_int count, slacks_values *sum)
{
    for (hsep_int l = 0; l < count; l++) {
        sum->of[count == 4 ? l : 4] +=
            (side->s[r + l] + alpha->primal * side->ds[r + l]) * (side->z[r + l] + alpha->dual * side->dz[r + l]);
    }
}

HSEP_API hsep_real hsep_slacks_predicted(const hsep_slacks *self)
{
    const hsep_lengths alpha = slacks_lengths(self);
    slacks_values sum = {{0.0}};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                slacks_after(&self->side[i], &alpha, r, 4, &sum);
            }
            slacks_after(&self->side[i], &alpha, r, self->range[order].end - r, &sum);
        }
    }
    return slacks_sum(&sum) / self->sides;
}

HSEP_API void hsep_slacks_correct(const hsep_slacks *self, hsep_real sigma_mu)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_real *restrict r_c = side->r_c;
            for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
                r_c[r] = (sigma_mu - side->s[r] * side->z[r] - side->ds[r] * side->dz[r]) * side->inverse[r];
            }
        }
    }
}

HSEP_API hsep_real hsep_slacks_move(const hsep_slacks *self)
{
    const hsep_lengths alpha = slacks_lengths(self);
    const hsep_real primal = alpha.primal >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.primal;
    const hsep_real dual = alpha.dual >= 1.0 ? 1.0 : HSEP_QP_TAU * alpha.dual;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_real *restrict s = side->s, *restrict z = side->z, *restrict inverse = side->inverse;
            for (hsep_int r = self->range[order].begin; r < self->range[order].end; r++) {
                s[r] += primal * side->ds[r];
                z[r] += dual * side->dz[r];
                inverse[r] = 1.0 / (s[r] + self->rho * z[r]);
            }
        }
    }
    return primal;
}

#include "hsep_slacks.h"

#include "hsep_math.h"
#include "hsep_vector.h"

#include <string.h>

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

/* Sums or maxima of rows, four side by side, and of the rows left over. */
typedef struct {
    hsep_lanes of_four[HSEP_OF_FOUR];
    hsep_real left;
} slacks_values;

static hsep_real slacks_sum(const slacks_values *values)
{
    hsep_real s[4];
    memcpy(s, values->of_four, sizeof s);
    return ((s[0] + s[1]) + (s[2] + s[3])) + values->left;
}

static hsep_real slacks_largest(const slacks_values *values)
{
    hsep_real s[4], largest = values->left;
    memcpy(s, values->of_four, sizeof s);
    for (int i = 0; i < 4; i++) {
        largest = s[i] > largest ? s[i] : largest;
    }
    return largest;
}

/* ds = B dx + r_p + rho dz, dz = r_c - z (B dx + r_p) / (s + rho z), of the rows of a vector and of one. */
static inline void slacks_steps(
    const hsep_slacks *self, int i, hsep_int r, hsep_lanes *restrict ds, hsep_lanes *restrict dz)
{
    const hsep_side *side = &self->side[i];
    const hsep_lanes to = slacks_sign[i] * *hsep_lanes_const(self->Adx + r) + *hsep_lanes_const(side->r_p + r);
    *dz = *hsep_lanes_const(side->r_c + r) - *hsep_lanes_const(side->z + r) * *hsep_lanes_const(side->inverse + r) * to;
    *ds = to + self->rho * *dz;
}

static inline void slacks_step(const hsep_slacks *self, int i, hsep_int r, hsep_real *ds, hsep_real *dz)
{
    const hsep_side *side = &self->side[i];
    const hsep_real to = slacks_sign[i] * self->Adx[r] + side->r_p[r];
    *dz = side->r_c[r] - side->z[r] * side->inverse[r] * to;
    *ds = to + self->rho * *dz;
}

HSEP_API void hsep_slacks_push(const hsep_slacks *self)
{
    const hsep_side *low = &self->side[0], *high = &self->side[1];
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_int r = self->range[order].begin;
        for (; r + HSEP_LANES <= self->range[order].end; r += HSEP_LANES) {
            *hsep_lanes_at(self->work + r) =
                (*hsep_lanes_const(low->r_c + r) - *hsep_lanes_const(low->z + r) * *hsep_lanes_const(low->inverse + r) *
                                                       *hsep_lanes_const(low->r_p + r)) -
                (*hsep_lanes_const(high->r_c + r) - *hsep_lanes_const(high->z + r) *
                                                        *hsep_lanes_const(high->inverse + r) *
                                                        *hsep_lanes_const(high->r_p + r));
        }
        for (; r < self->range[order].end; r++) {
            self->work[r] = (low->r_c[r] - low->z[r] * low->inverse[r] * low->r_p[r]) -
                            (high->r_c[r] - high->z[r] * high->inverse[r] * high->r_p[r]);
        }
    }
}

/* Steps ds and dz, and their lengths to where all values + length change stay >= 0: the largest -change / value is its
 * inverse. */
static hsep_lengths slacks_lengths(const hsep_slacks *self)
{
    slacks_values primal, dual;
    memset(&primal, 0, sizeof primal);
    memset(&dual, 0, sizeof dual);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                for (int l = 0; l < HSEP_OF_FOUR; l++) {
                    const hsep_int at = r + (hsep_int)(HSEP_LANES * l);
                    hsep_lanes ds, dz;
                    slacks_steps(self, i, at, &ds, &dz);
                    *hsep_lanes_at(side->ds + at) = ds;
                    *hsep_lanes_at(side->dz + at) = dz;
                    primal.of_four[l] = hsep_lanes_larger(-ds / *hsep_lanes_const(side->s + at), primal.of_four[l]);
                    dual.of_four[l] = hsep_lanes_larger(-dz / *hsep_lanes_const(side->z + at), dual.of_four[l]);
                }
            }
            for (; r < self->range[order].end; r++) {
                hsep_real ds, dz;
                slacks_step(self, i, r, &ds, &dz);
                side->ds[r] = ds;
                side->dz[r] = dz;
                primal.left = -ds / side->s[r] > primal.left ? -ds / side->s[r] : primal.left;
                dual.left = -dz / side->z[r] > dual.left ? -dz / side->z[r] : dual.left;
            }
        }
    }
    const hsep_real of_s = slacks_largest(&primal), of_z = slacks_largest(&dual);
    return (hsep_lengths){.primal = of_s > 1.0 ? 1.0 / of_s : 1.0, .dual = of_z > 1.0 ? 1.0 / of_z : 1.0};
}

HSEP_API hsep_real hsep_slacks_residuals(const hsep_slacks *self, hsep_real *primal, hsep_real *beyond)
{
    slacks_values sum, largest, outside;
    memset(&sum, 0, sizeof sum);
    memset(&largest, 0, sizeof largest);
    for (int l = 0; l < HSEP_OF_FOUR; l++) {
        outside.of_four[l] = (hsep_lanes){0.0} - INFINITY;
    }
    outside.left = -INFINITY;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                for (int l = 0; l < HSEP_OF_FOUR; l++) {
                    const hsep_int at = r + (hsep_int)(HSEP_LANES * l);
                    const hsep_lanes s = *hsep_lanes_const(side->s + at), z = *hsep_lanes_const(side->z + at);
                    const hsep_lanes inverse = *hsep_lanes_const(side->inverse + at), product = s * z;
                    const hsep_lanes distance =
                        slacks_sign[i] * (*hsep_lanes_const(self->Ax + at) - *hsep_lanes_const(side->b + at));
                    const hsep_lanes r_p = distance - s, weight = z * inverse;
                    sum.of_four[l] += product;
                    largest.of_four[l] = hsep_lanes_larger(hsep_lanes_larger(r_p, -r_p), largest.of_four[l]);
                    outside.of_four[l] = hsep_lanes_larger(-distance, outside.of_four[l]);
                    *hsep_lanes_at(side->r_p + at) = r_p;
                    *hsep_lanes_at(side->r_c + at) = -product * inverse;
                    if (i == 0) {
                        *hsep_lanes_at(self->Adx + at) = weight;
                        *hsep_lanes_at(self->work + at) = z;
                    } else {
                        *hsep_lanes_at(self->Adx + at) += weight;
                        *hsep_lanes_at(self->work + at) -= z;
                    }
                }
            }
            for (; r < self->range[order].end; r++) {
                const hsep_real s = side->s[r], z = side->z[r], weight = z * side->inverse[r];
                const hsep_real distance = slacks_sign[i] * (self->Ax[r] - side->b[r]), r_p = distance - s;
                sum.left += s * z;
                largest.left = hsep_fabs(r_p) > largest.left ? hsep_fabs(r_p) : largest.left;
                outside.left = -distance > outside.left ? -distance : outside.left;
                side->r_p[r] = r_p;
                side->r_c[r] = -(s * z) * side->inverse[r];
                self->Adx[r] = i == 0 ? weight : self->Adx[r] + weight;
                self->work[r] = i == 0 ? z : self->work[r] - z;
            }
        }
    }
    *primal = slacks_largest(&largest);
    *beyond = slacks_largest(&outside);
    return slacks_sum(&sum) / self->sides;
}

HSEP_API hsep_real hsep_slacks_predicted(const hsep_slacks *self)
{
    const hsep_lengths alpha = slacks_lengths(self);
    slacks_values sum;
    memset(&sum, 0, sizeof sum);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_int r = self->range[order].begin;
            for (; r + 4 <= self->range[order].end; r += 4) {
                for (int l = 0; l < HSEP_OF_FOUR; l++) {
                    const hsep_int at = r + (hsep_int)(HSEP_LANES * l);
                    const hsep_lanes ds = *hsep_lanes_const(side->ds + at), dz = *hsep_lanes_const(side->dz + at);
                    sum.of_four[l] += (*hsep_lanes_const(side->s + at) + alpha.primal * ds) *
                                      (*hsep_lanes_const(side->z + at) + alpha.dual * dz);
                }
            }
            for (; r < self->range[order].end; r++) {
                const hsep_real ds = side->ds[r], dz = side->dz[r];
                sum.left += (side->s[r] + alpha.primal * ds) * (side->z[r] + alpha.dual * dz);
            }
        }
    }
    return slacks_sum(&sum) / self->sides;
}

HSEP_API void hsep_slacks_correct(const hsep_slacks *self, hsep_real sigma_mu)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (int i = 0; i < 2; i++) {
            const hsep_side *side = &self->side[i];
            hsep_int r = self->range[order].begin;
            for (; r + HSEP_LANES <= self->range[order].end; r += HSEP_LANES) {
                const hsep_lanes ds = *hsep_lanes_const(side->ds + r), dz = *hsep_lanes_const(side->dz + r);
                *hsep_lanes_at(side->r_c + r) =
                    (sigma_mu - *hsep_lanes_const(side->s + r) * *hsep_lanes_const(side->z + r) - ds * dz) *
                    *hsep_lanes_const(side->inverse + r);
            }
            for (; r < self->range[order].end; r++) {
                const hsep_real ds = side->ds[r], dz = side->dz[r];
                side->r_c[r] = (sigma_mu - side->s[r] * side->z[r] - ds * dz) * side->inverse[r];
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
            hsep_int r = self->range[order].begin;
            for (; r + HSEP_LANES <= self->range[order].end; r += HSEP_LANES) {
                const hsep_lanes ds = *hsep_lanes_const(side->ds + r), dz = *hsep_lanes_const(side->dz + r);
                const hsep_lanes s = *hsep_lanes_const(side->s + r) + primal * ds;
                const hsep_lanes z = *hsep_lanes_const(side->z + r) + dual * dz;
                *hsep_lanes_at(side->s + r) = s;
                *hsep_lanes_at(side->z + r) = z;
                *hsep_lanes_at(side->inverse + r) = 1.0 / (s + self->rho * z);
            }
            for (; r < self->range[order].end; r++) {
                const hsep_real ds = side->ds[r], dz = side->dz[r];
                side->s[r] += primal * ds;
                side->z[r] += dual * dz;
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
    return primal;
}

#include "hsep_slacks.h"

#include <math.h>

static const double slacks_least = 0.3;     /* smallest initial slack, in shares */
static const double slacks_first_mu = 10.0; /* initial mu, as a share of the cost per bound */
static const double slacks_tau = 0.995;     /* fraction of the step to the nearest bound */

/* B x - b of a row: A x - low, or high - A x. */
static inline double slacks_distance(int i, double Ax, double b) { return i == 0 ? Ax - b : b - Ax; }

HSEP_API void hsep_slacks_begin(const hsep_slacks *self, double cost)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                side->s[r] = fmax(slacks_distance(i, self->Ax[r], side->b[r]), slacks_least);
                side->z[r] = slacks_first_mu * cost / side->s[r];
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
}

/* ds = B dx + r_p + rho dz, dz = r_c - z (B dx + r_p) / (s + rho z). */
static inline void slacks_step(const hsep_slacks *self, int i, uint64_t r, double *ds, double *dz)
{
    const hsep_side *side = &self->side[i];
    const double to = (i == 0 ? self->Adx[r] : -self->Adx[r]) + side->r_p[r];
    *dz = side->r_c[r] - side->z[r] * side->inverse[r] * to;
    *ds = to + self->rho * *dz;
}

HSEP_API void hsep_slacks_push(const hsep_slacks *self)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            double push[2];
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                push[i] = side->r_c[r] - side->z[r] * side->inverse[r] * side->r_p[r];
            }
            self->work[r] = push[0] - push[1];
        }
    }
}

/* Shorten a step to where value + length change stays >= 0. */
static inline void slacks_shorten(double *length, double value, double change)
{
    if (change < 0.0 && value < -change * *length) {
        *length = -value / change;
    }
}

static hsep_lengths slacks_lengths(const hsep_slacks *self)
{
    hsep_lengths alpha = {1.0, 1.0};
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                double ds, dz;
                slacks_step(self, i, r, &ds, &dz);
                slacks_shorten(&alpha.primal, self->side[i].s[r], ds);
                slacks_shorten(&alpha.dual, self->side[i].z[r], dz);
            }
        }
    }
    return alpha;
}

HSEP_API double hsep_slacks_residuals(const hsep_slacks *self, double *primal)
{
    double sum = 0.0;
    *primal = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            double weight = 0.0;
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                side->r_p[r] = slacks_distance(i, self->Ax[r], side->b[r]) - side->s[r];
                sum += side->s[r] * side->z[r];
                *primal = fmax(*primal, fabs(side->r_p[r]));
                weight += side->z[r] * side->inverse[r];
                side->r_c[r] = -side->s[r] * side->z[r] * side->inverse[r];
            }
            self->Adx[r] = weight;
            self->work[r] = self->side[0].z[r] - self->side[1].z[r];
        }
    }
    return sum / self->sides;
}

HSEP_API double hsep_slacks_predicted(const hsep_slacks *self)
{
    const hsep_lengths alpha = slacks_lengths(self);
    double sum = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                double ds, dz;
                slacks_step(self, i, r, &ds, &dz);
                sum += (self->side[i].s[r] + alpha.primal * ds) * (self->side[i].z[r] + alpha.dual * dz);
            }
        }
    }
    return sum / self->sides;
}

HSEP_API void hsep_slacks_correct(const hsep_slacks *self, double sigma_mu)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                double ds, dz;
                slacks_step(self, i, r, &ds, &dz);
                side->r_c[r] = (sigma_mu - side->s[r] * side->z[r] - ds * dz) * side->inverse[r];
            }
        }
    }
}

HSEP_API double hsep_slacks_move(const hsep_slacks *self)
{
    const hsep_lengths alpha = slacks_lengths(self);
    const double primal = alpha.primal >= 1.0 ? 1.0 : slacks_tau * alpha.primal;
    const double dual = alpha.dual >= 1.0 ? 1.0 : slacks_tau * alpha.dual;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        for (uint64_t r = self->range[order].begin; r < self->range[order].end; r++) {
            for (int i = 0; i < 2; i++) {
                const hsep_side *side = &self->side[i];
                double ds, dz;
                slacks_step(self, i, r, &ds, &dz);
                side->s[r] += primal * ds;
                side->z[r] += dual * dz;
                side->inverse[r] = 1.0 / (side->s[r] + self->rho * side->z[r]);
            }
        }
    }
    return primal;
}

/* Slacks and multipliers of the bounds  low <= A x <= high  of an interior-point method, row by row: residuals, steps
 * and their lengths. Private to hsep_interior.c, whose memory they are in.
 *
 * Side 0 are the lower bounds, B x >= b with B = A and b = low, side 1 the upper ones, B = -A and b = -high.
 * A proximal term rho regularises the multipliers:  ds = B dx + r_p + rho dz,  z ds + s dz = r_c (s + rho z).
 */
#ifndef HSEP_SLACKS_H
#define HSEP_SLACKS_H

#include "hsep_api.h"
#include "hsep_real.h"
#include "hsep_splines.h"

/* One side of the bounds, all (4 preview,): slack s = B x - b and multiplier z, both > 0. */
typedef struct {
    hsep_real *b;       /* low or high */
    hsep_real *s, *z;   /* shares; m2 */
    hsep_real *inverse; /* 1 / (s + rho z) */
    hsep_real *r_c;     /* complementarity that a step aims at, times inverse */
    hsep_real *r_p;     /* primal residual B x - b - s */
    hsep_real *ds, *dz; /* steps of s and z, once their lengths are known */
} hsep_side;

typedef struct {
    hsep_real rho;       /* 1/m2, proximal regularisation of the multipliers */
    hsep_real sides;     /* number of bounds, low and high ones */
    hsep_real *Ax, *Adx; /* rows of the iterate and of its step */
    hsep_real *work;     /* a row's value of both sides together */
    hsep_side side[2];   /* low and high */
    struct {
        hsep_int begin, end;
    } range[HSEP_ORDERS]; /* the rows of an order that x touches, begin ... end - 1 */
} hsep_slacks;

/* Lengths of a step, 0 ... 1. */
typedef struct {
    hsep_real primal, dual;
} hsep_lengths;

/* Begin with Ax and the bounds as they are. cost: m2, of the beginning, for each of the bounds. again: whether z are
 * those of a programme with the same bounds and nearly the same cost. */
HSEP_API void hsep_slacks_begin(const hsep_slacks *self, hsep_real cost, int again);

/* Return mu, the mean of s z; *primal: the largest primal residual; *beyond: by how much the worst bound is exceeded,
 * negative inside all of them. The weights of A' W A go to Adx, z's difference of
 * the sides to work, and the predictor's r_c is set, as if s z = 0 could be reached at once. */
HSEP_API hsep_real hsep_slacks_residuals(const hsep_slacks *self, hsep_real *primal, hsep_real *beyond);

/* work := B' sides of r_c - z r_p / (s + rho z), what the bounds add to the dual residual on the right-hand side. */
HSEP_API void hsep_slacks_push(const hsep_slacks *self);

/* mu after the predictor's step, as far as s and z stay >= 0. */
HSEP_API hsep_real hsep_slacks_predicted(const hsep_slacks *self);

/* The corrector's r_c: the centre sigma mu, with the curvature ds dz that the predictor shows. */
HSEP_API void hsep_slacks_correct(const hsep_slacks *self, hsep_real sigma_mu);

/* Go by the corrector's step, as far as s and z stay > 0; return the primal length. */
HSEP_API hsep_real hsep_slacks_move(const hsep_slacks *self);

#endif

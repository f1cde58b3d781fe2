/* Regression with a penalty of its own on each weight, from a Gram matrix, solved as rows come.
 *
 * w = argmin_w sum_k [target(k) - w' phi(k)]^2 + sum_i penalties_i w_i^2
 *
 * The Gram matrix squares the condition of the rows, but the penalties bound it: no pivot of its Cholesky factor is
 * less than its penalty. Penalties of the head of the features are known before the last rows are, penalties of the
 * tail are not: hsep_solution_begin takes the Gram matrix as it is, hsep_solution_advance factors the head by and by,
 * hsep_solution_row takes rows that come meanwhile, which go into what is factored by reflections, and are added to
 * the rest. What is left for hsep_solution_finish are the tail and the last rows. The solution is the same to rounding
 * as with all rows at once.
 *
 * The head is factored from its last feature to its first, as rows of a Gram matrix have it, before the tail: where
 * these are lags, penalties grow with them, and the largest pivots come first, as pivoting would have it.
 */
#ifndef HSEP_SOLUTION_H
#define HSEP_SOLUTION_H

#include "hsep_gram.h"

/* Least pivot, m2, where a penalty underflows; least pivot of the target, relative to its sum of squares; and the part
 * of the sum of squares that rounding leaves unresolved, relative to the targets' sum of squares. */
#ifdef HSEP_FLOAT32
#define HSEP_SOLUTION_LEAST 1e-36F
#define HSEP_SOLUTION_OF_TARGET 6e-8F
#define HSEP_SOLUTION_RESOLUTION 3e-7F
#else
#define HSEP_SOLUTION_LEAST 1e-40
#define HSEP_SOLUTION_OF_TARGET 1e-16
#define HSEP_SOLUTION_RESOLUTION 1e-14
#endif

#define HSEP_SOLUTION_ABREAST 4 /* rows that are taken in together, or whose leverages are computed side by side */

typedef struct {
    hsep_int n_head, n_tail; /* features */
    hsep_int room;           /* rows that may wait */
    hsep_int begun;          /* whether it has */
    hsep_int factored;       /* rows of the head that are */
    hsep_int waiting;        /* rows that have come since, and are not in the factor yet */
    hsep_int finished;       /* whether left is valid */
    hsep_real square;        /* sum of the squares of the targets */
    hsep_int penalties;      /* (n_tail + n_head,) */
    hsep_int weights;        /* (n_tail + n_head,) */
    hsep_int factor;         /* triangle [R z; 0 rho] of the head backwards, tail and target, by rows */
    hsep_int left;           /* triangle of tail and target: what the head leaves of them, without penalties */
    hsep_int least;          /* (n_head + n_tail + 1,) bounds on the pivots */
    hsep_int rows;           /* (room, n_head + n_tail + 1) rows that wait, in that order */
    hsep_int work;           /* (HSEP_SOLUTION_ABREAST, n_head + n_tail + 1) rows */
    hsep_int abreast;        /* the same side by side, where there are vectors */
} hsep_solution;
HSEP_ASSERT_WORDS(hsep_solution, 16);

/* A block of about 4 n^2 bytes. */
HSEP_API hsep_real hsep_solution_size(hsep_int n_head, hsep_int n_tail, hsep_int room);
HSEP_API void hsep_solution_init(hsep_solution *self, hsep_int n_head, hsep_int n_tail, hsep_int room);

/* Give up the rows and the factor so far; the next solution has not begun. */
HSEP_API void hsep_solution_reset(hsep_solution *self);

/* Begin with the rows of a Gram matrix so far, and other's, weighed by weight, which is settled, or NULL. Its
 * last n_head + n_tail features count. Penalties of the head, >= 0, are in the block, after the tail's. Rows
 * that wait in the Gram matrix wait here, too. */
HSEP_API void hsep_solution_begin(hsep_solution *self, const hsep_gram *gram, const hsep_gram *other, hsep_real weight);

/* Take another row of n features and its target, as the Gram matrix has them; the rows after room are not taken. */
HSEP_API void hsep_solution_row(hsep_solution *self, const hsep_real row[], hsep_int n);

/* Multiply-adds at most until the head is factored and has taken in the rows that wait, and the ones to come. */
HSEP_API hsep_real hsep_solution_left(const hsep_solution *self, hsep_int to_come);

/* Take in four rows that wait, or factor some of the head, until an amount of multiply-adds is spent, and return what
 * is left of it; the last part may exceed it by up to 4 (n + 1)^2. With all everything is done, whatever the amount. */
HSEP_API hsep_real hsep_solution_advance(hsep_solution *self, hsep_real amount, int all);

/* Solve for the weights; penalties: > 0, of all features, are in the block. Return the sum of the squares of the
 * rows about them, of which rounding leaves 1e-14 of the square of the targets. Cost: what was left to be advanced, and
 * n_tail^3 / 6 + n^2 / 2 multiply-adds. May be called again with other penalties of the tail. */
HSEP_API hsep_real hsep_solution_finish(hsep_solution *self);

/* phi' (R' R)^-1 phi, with all rows in R, of the first count of HSEP_SOLUTION_ABREAST rows phi, which are the block's
 * work, in that order, and are used up: the variances of w' phi relative to the variance of the noise. Cost: n^2 / 2
 * multiply-adds for each; where there are vectors two cost as much as four. */
HSEP_API void hsep_solution_leverages(hsep_solution *self, hsep_int count, hsep_real leverages[HSEP_SOLUTION_ABREAST]);

#endif

/* Recursive ridge regression, one row a call, carried as a triangular factor; eq. (6).
 *
 * w = argmin_w sum_k [target(k) - w' phi(k)]^2 + lambda |w|^2
 *
 * The QR factor [R z; 0 rho] of all rows [phi | target] so far, with sqrt(lambda) I as its first R, is updated by
 * Givens rotations without square roots (Gentleman 1973): R = D^(1/2) U with a unit triangle U. Weights and data
 * never meet as normal equations, so nothing is squared but single numbers. Error bound: at most sqrt(2) times the
 * bound of ordinary Givens rotations, see hsep_regression.c. The rounding error of an entry is kept and added back with
 * the next row (compensated summation), so that errors do not pile up over 10^8 rows.
 */
#ifndef HSEP_REGRESSION_H
#define HSEP_REGRESSION_H

#include "hsep_layout.h"

typedef struct {
    hsep_int n;         /* features */
    hsep_real n_rows;   /* rows so far */
    hsep_int inverse_d; /* (n,) 1/D */
    hsep_int row;       /* (n + 1,) the row that comes next */
    hsep_int factor;    /* (n (n + 1) / 2,) U and z, by rows, from after the diagonal on */
    hsep_int carries;   /* (n (n + 1) / 2,) what rounding took from them */
} hsep_regression;
HSEP_ASSERT_WORDS(hsep_regression, 6);

/* A block of about 8 n^2 bytes for n >= 1 features and lambda > 0, in the unit of a row's entry squared; less than
 * 1e-290 counts as 1e-290, so that its reciprocal is a number. */
HSEP_API hsep_real hsep_regression_size(hsep_int n);
HSEP_API void hsep_regression_init(hsep_regression *self, hsep_int n, hsep_real lambda);

/* Where the next row goes, (n + 1,): phi, then its target. */
HSEP_API hsep_real *hsep_regression_row(hsep_regression *self);

/* Fold that row into the factor; the row's memory is used up. All n + 1 entries must be finite. Cost: n^2 / 2 times 2
 * multiplications and 5 additions, and 2 n divisions, no matter how many rows were there before. */
HSEP_API void hsep_regression_fold(hsep_regression *self);

/* Solve R w = z for w, (n,). Cost: n^2 / 2 multiply-adds. */
HSEP_API void hsep_regression_solve(const hsep_regression *self, hsep_real w[]);

/* Take over row i of a factor [R z; 0 rho], its entries i ... n, which the caller has put into
 * hsep_regression_row. All n + 1 rows make a factor. Cost: n divisions. */
HSEP_API void hsep_regression_load(hsep_regression *self, hsep_int i);

/* Write the factor, a triangle of n + 1 rows, with 0 for rho. */
HSEP_API void hsep_regression_write(const hsep_regression *self, hsep_real triangle[]);

#endif

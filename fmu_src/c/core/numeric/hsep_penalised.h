/* Regression of the first features with a penalty of its own on each weight, from the factor of all rows.
 *
 * The triangle of all features holds that of the first ones, so a copy of it with a row for each penalty suffices.
 * Reentrant; allocates nothing.
 */
#ifndef HSEP_PENALISED_H
#define HSEP_PENALISED_H

#include "hsep_api.h"
#include "hsep_regression.h"

#define HSEP_NO_PENALTY 1e-40 /* lambda of the factor itself, m2: penalties come with each solution */

/* Add the rows of other, a regression of the same features, each weighed by weight; work: hsep_block_fold_size(n, n)
 * doubles. Cost: n^3 / 6 times 2 multiply-adds. */
HSEP_API void hsep_penalised_add(hsep_regression *self, const hsep_regression *other, double weight, double work[]);

/* Solve for the weights w of the first m features, as many as solved has, each with a penalty of its own:
 *   w = argmin_w sum_k [target(k) - w' phi(k)]^2 + sum_i penalties_i w_i^2 + lambda |w|^2
 * solved: another block, which holds the triangle with these penalties then; what it held before does not matter, and
 * its diagonal is that of hsep_regression_init; work: hsep_block_fold_size(n, n) doubles for the n features of self.
 * Return the first sum, lambda |w|^2 with it. Cost: m^3 / 6 times 2 multiply-adds. */
HSEP_API double hsep_penalised_solve(
    const hsep_regression *self, const double penalties[], hsep_regression *solved, double w[], double work[]);

/* phi' (R' R)^-1 phi of the row phi, (n,), in hsep_regression_row, which is used up: the variance of w' phi relative to
 * that of the noise; wide: hsep_is_wide, asked once for many rows. Cost: n^2 / 2 multiply-adds. */
HSEP_API double hsep_penalised_leverage(hsep_regression *self, int wide);

#endif

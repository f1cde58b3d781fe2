/* Cholesky factor of a symmetric, positive definite matrix, P = R' R, and the equations it solves.
 *
 * A triangle of n rows is kept without gaps, by rows from the diagonal to the right: n (n + 1) / 2 numbers.
 * Reentrant; allocates nothing.
 */
#ifndef HSEP_CHOLESKY_H
#define HSEP_CHOLESKY_H

#include "hsep_layout.h"

#define HSEP_CHOLESKY_PANEL 8 /* rows of a triangle that are finished together */

/* Doubles of a triangle of n rows. */
static inline hsep_real hsep_triangle(hsep_int n) { return 0.5 * (hsep_real)n * ((hsep_real)n + 1.0); }

/* Turn the rows first ... last - 1 of the upper triangle of P into those of R, in place, after others that are
 * finished; what they leave is subtracted from the rows below. Returns 0 if P is not positive definite or not finite;
 * the triangle is used up then. least: (n,) > 0, what each pivot is known to exceed, where rounding may hide it; NULL:
 * nothing is. Cost: n^3 / 6 multiply-adds for all rows. */
HSEP_API int hsep_cholesky_rows(
    hsep_real triangle[], hsep_int n, hsep_int first, hsep_int last, const hsep_real least[]);

/* Take one row x, (n,), or four, (4, n), into a triangle of which the first head rows are finished: R' R becomes
 * R' R + x' x, by a reflection of each pivot. The rows are used up. Cost: for each row about head (n - head / 2) times
 * two, and (n - head)^2 / 2 multiply-adds. */
HSEP_API void hsep_cholesky_take_one(hsep_real triangle[], hsep_int n, hsep_int head, hsep_real x[]);
HSEP_API void hsep_cholesky_take_four(hsep_real triangle[], hsep_int n, hsep_int head, hsep_real x[]);

/* Turn the first count of b, (n,), into the solution y of R' y = b by the first count rows, and subtract from those
 * after them what these rows leave of them. Cost: count (n - count / 2) multiply-adds. */
HSEP_API void hsep_cholesky_forward(const hsep_real triangle[], hsep_int n, hsep_int count, hsep_real b[]);

/* Turn b, (count,), into the solution x of R x = b by the first count rows and columns. Cost: count^2 / 2. */
HSEP_API void hsep_cholesky_backward(const hsep_real triangle[], hsep_int n, hsep_int count, hsep_real b[]);

/* Turn b, (n,), into the solution x of R' R x = b. Cost: n^2 multiply-adds. */
HSEP_API void hsep_cholesky_solve(const hsep_real triangle[], hsep_int n, hsep_real b[]);

#endif

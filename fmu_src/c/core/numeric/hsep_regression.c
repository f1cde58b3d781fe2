#include "hsep_regression.h"

#include "hsep_cholesky.h"

static const hsep_real regression_lambda_min = HSEP_TINY(1e-290);

static hsep_real regression_lay_out(hsep_regression *self, hsep_int n)
{
    hsep_real end = HSEP_WORDS(hsep_regression);
    self->n = n;
    self->inverse_d = hsep_take(&end, (hsep_real)n);
    self->row = hsep_take(&end, (hsep_real)n + 1.0);
    self->factor = hsep_take(&end, hsep_triangle(n));
    self->carries = hsep_take(&end, hsep_triangle(n));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_regression_size(hsep_int n) { return regression_lay_out(&(hsep_regression){0}, n); }

HSEP_API void hsep_regression_init(hsep_regression *self, hsep_int n, hsep_real lambda)
{
    memset(self, 0, (size_t)hsep_regression_size(n));
    (void)regression_lay_out(self, n);
    for (hsep_int i = 0; i < n; i++) {
        hsep_at(self, self->inverse_d)[i] = 1.0 / (lambda < regression_lambda_min ? regression_lambda_min : lambda);
    }
}

HSEP_API hsep_real *hsep_regression_row(hsep_regression *self) { return hsep_at(self, self->row); }

/* Rotate n entries x of the row with a row of U's:  x := x - pivot u,  u := u + gain x, whose rounding error is
 * kept in carry and added back next time (Kahan 1965). */
static void regression_rotate(
    hsep_real *restrict u, hsep_real *restrict carry, hsep_real *restrict x, hsep_int n, hsep_real pivot,
    hsep_real gain)
{
    for (hsep_int j = 0; j < n; j++) {
        const hsep_real before = u[j], left = x[j] - pivot * before;
        const hsep_real change = gain * left + carry[j], after = before + change;
        carry[j] = change - (after - before);
        u[j] = after;
        x[j] = left;
    }
}

/* The same, but  u := keep u + gain x  of the x before, which loses nothing where keep is small. */
static void regression_rotate_large(
    hsep_real *restrict u, hsep_real *restrict carry, hsep_real *restrict x, hsep_int n, hsep_real pivot,
    hsep_real gain, hsep_real keep)
{
    for (hsep_int j = 0; j < n; j++) {
        const hsep_real before = x[j];
        x[j] = before - pivot * u[j];
        u[j] = keep * u[j] + gain * before;
        carry[j] = 0.0;
    }
}

HSEP_API void hsep_regression_fold(hsep_regression *self)
{
    hsep_real *inverse_d = hsep_at(self, self->inverse_d), *x = hsep_regression_row(self);
    hsep_real *u = hsep_at(self, self->factor), *carry = hsep_at(self, self->carries);
    /* The row still weighs 1/v. With x_j its entry at the pivot, u a row of U and d that row's weight:
     *   v' = v + x_j^2 / d          d' = d v'/v         keep = v / v' = cos^2        gain = x_j / (d v')
     *   x := x - x_j u              u := keep u + gain x = u + gain (x - x_j u)
     * The last form is the cheapest and its rounding error is a Givens rotation's divided by the cosine:
     * it is taken where cos^2 >= 1/2, and keep u + gain x, without that factor, elsewhere. */
    hsep_real v = 1.0;
    for (hsep_int i = 0, left = self->n; left > 0; i++, left--) {
        const hsep_real pivot = *x++, scaled = pivot * inverse_d[i], next = v + pivot * scaled;
        const hsep_real gain = scaled / next, keep = v / next;
        if (next > 2.0 * v) {
            regression_rotate_large(u, carry, x, left, pivot, gain, keep);
        } else {
            regression_rotate(u, carry, x, left, pivot, gain);
        }
        inverse_d[i] *= keep;
        v = next;
        u += left;
        carry += left;
    }
    self->n_rows += 1.0;
}

HSEP_API void hsep_regression_solve(const hsep_regression *self, hsep_real w[])
{
    const hsep_int n = self->n;
    const hsep_real *u = hsep_at_const(self, self->carries); /* after the last row */
    /* U w = z from the last row to the first: by fours from the next multiple of 4 on, then the others one by one. */
    for (hsep_int i = n; i-- > 0;) {
        const hsep_int fours = i - i % 4 + 4, rest = fours > n ? n : n - n % 4;
        u -= n - i;
        const hsep_real *row = u - (i + 1); /* by columns; z is column n */
        hsep_real sum = 0.0;
        for (hsep_int j = fours; j + 4 <= n; j += 4) {
            sum += row[j] * w[j] + row[j + 1] * w[j + 1] + row[j + 2] * w[j + 2] + row[j + 3] * w[j + 3];
        }
        w[i] = row[n] - sum;
        for (hsep_int j = rest; j < n; j++) {
            w[i] -= row[j] * w[j];
        }
        for (hsep_int j = i + 1; j < fours && j < n; j++) {
            w[i] -= row[j] * w[j];
        }
    }
}

HSEP_API void hsep_regression_load(hsep_regression *self, hsep_int i)
{
    const hsep_int n = self->n, place = (hsep_int)(hsep_triangle(n) - hsep_triangle(n - i));
    const hsep_real *row = hsep_regression_row(self);
    if (i == n) { /* rho, which no weight depends on */
        return;
    }
    hsep_at(self, self->inverse_d)[i] = 1.0 / hsep_fmax(row[0] * row[0], regression_lambda_min);
    for (hsep_int j = 0; j < n - i; j++) { /* U = D^(-1/2) R, and z alike */
        hsep_at(self, self->factor)[place + j] = row[j + 1] / row[0];
        hsep_at(self, self->carries)[place + j] = 0.0;
    }
}

HSEP_API void hsep_regression_write(const hsep_regression *self, hsep_real triangle[])
{
    const hsep_real *u = hsep_at_const(self, self->factor), *inverse_d = hsep_at_const(self, self->inverse_d);
    for (hsep_int i = 0, left = self->n; left > 0; i++, left--) { /* R = D^(1/2) U */
        const hsep_real root = 1.0 / hsep_sqrt(inverse_d[i]);
        *triangle++ = root;
        for (hsep_int j = 0; j < left; j++) {
            *triangle++ = root * *u++;
        }
    }
    *triangle = 0.0;
}

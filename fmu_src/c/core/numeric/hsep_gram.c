#include "hsep_gram.h"

#include "hsep_cholesky.h"

static hsep_real gram_lay_out(hsep_gram *self, hsep_int n)
{
    hsep_real end = HSEP_WORDS(hsep_gram);
    self->n = n;
    self->rows = hsep_take(&end, HSEP_GRAM_TOGETHER * ((hsep_real)n + 1.0));
    self->sums = hsep_take(&end, hsep_triangle(n + 1));
    self->carries = hsep_take(&end, hsep_triangle(n + 1));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_gram_size(hsep_int n) { return gram_lay_out(&(hsep_gram){0}, n); }

HSEP_API void hsep_gram_init(hsep_gram *self, hsep_int n)
{
    memset(self, 0, (size_t)hsep_gram_size(n));
    (void)gram_lay_out(self, n);
}

/* Add row a of the products of four rows, from its diagonal on, to the sums; their rounding errors are kept in the
 * carries and added back next time (Kahan 1965). */
static void gram_add_row(
    hsep_real *restrict sums, hsep_real *restrict carries, const hsep_real a[4], const hsep_real *restrict x0,
    const hsep_real *restrict x1, const hsep_real *restrict x2, const hsep_real *restrict x3, hsep_int n)
{
    const hsep_real a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
    for (hsep_int j = 0; j < n; j++) {
        const hsep_real before = sums[j];
        const hsep_real change = ((a0 * x0[j] + a1 * x1[j]) + (a2 * x2[j] + a3 * x3[j])) + carries[j];
        const hsep_real after = before + change;
        carries[j] = change - (after - before);
        sums[j] = after;
    }
}

HSEP_API void hsep_gram_settle(hsep_gram *self)
{
    const hsep_int width = self->n + 1;
    hsep_real *x = hsep_at(self, self->rows), *sums = hsep_at(self, self->sums),
              *carries = hsep_at(self, self->carries);
    if (self->waiting == 0) {
        return;
    }
    hsep_zero(x + width * self->waiting, width * (HSEP_GRAM_TOGETHER - self->waiting));
    self->waiting = 0;
    for (hsep_int i = 0; i < width; i++, x++) {
        const hsep_int length = width - i;
        const hsep_real a[4] = {x[0], x[width], x[2 * width], x[3 * width]};
        gram_add_row(sums, carries, a, x, x + width, x + 2 * width, x + 3 * width, length);
        sums += length;
        carries += length;
    }
}

HSEP_API hsep_real *hsep_gram_row(hsep_gram *self)
{
    /* Only now: a window's last sample, the fourth mostly, has enough to do. */
    if (self->waiting == HSEP_GRAM_TOGETHER) {
        hsep_gram_settle(self);
    }
    return hsep_at(self, self->rows) + (self->n + 1) * self->waiting;
}

HSEP_API void hsep_gram_fold(hsep_gram *self)
{
    self->n_rows += 1.0;
    self->waiting++;
}

HSEP_API void hsep_gram_add(hsep_gram *self, hsep_gram *other, hsep_real weight)
{
    const hsep_int count = (hsep_int)hsep_triangle(self->n + 1);
    hsep_gram_settle(self);
    hsep_gram_settle(other);
    self->n_rows += weight * other->n_rows;
    hsep_axpy(hsep_at(self, self->sums), weight, hsep_at(other, other->sums), count);
    hsep_axpy(hsep_at(self, self->carries), weight, hsep_at(other, other->carries), count);
}

HSEP_API void hsep_gram_discount(hsep_gram *self, hsep_real weight)
{
    hsep_real *sums = hsep_at(self, self->sums);
    hsep_gram_settle(self);
    self->n_rows *= weight;
    for (hsep_int i = 0; i < 2 * (hsep_int)hsep_triangle(self->n + 1); i++) { /* carries follow the sums */
        sums[i] *= weight;
    }
}

HSEP_API void hsep_gram_add_to(const hsep_gram *self, hsep_int n_head, hsep_real triangle[])
{
    const hsep_int width = self->n + 1;
    const hsep_real *sums = hsep_at_const(self, self->sums), *carries = hsep_at_const(self, self->carries);
    for (hsep_int i = 0; i < width; i++) {
        for (hsep_int j = i; j < width; j++, triangle++) {
            const hsep_int a = hsep_gram_place(self, n_head, i), b = hsep_gram_place(self, n_head, j);
            const hsep_int first = a < b ? a : b, place = first * width - first * (first + 1) / 2 + (a < b ? b : a);
            const hsep_real *row = hsep_at_const(self, self->rows);
            *triangle = (*triangle + sums[place]) + carries[place];
            for (hsep_int waiting = 0; waiting < self->waiting; waiting++, row += width) {
                *triangle += row[a] * row[b];
            }
        }
    }
}

HSEP_API hsep_real hsep_gram_square(const hsep_gram *self)
{
    const hsep_int n = self->n;
    const hsep_real *target = hsep_at_const(self, self->rows) + n;
    hsep_real square = hsep_at_const(self, self->sums)[(hsep_int)hsep_triangle(n + 1) - 1];
    for (hsep_int b = 0; b < self->waiting; b++, target += n + 1) {
        square += *target * *target;
    }
    return square;
}

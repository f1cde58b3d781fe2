#include "hsep_gram.h"

#include "hsep_cholesky.h"
#include "hsep_vector.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Least pivot, m2, where a penalty underflows; and that of the target, relative to its square. */
static const double gram_least = 1e-40, gram_of_target = 1e-16;

/* Set what follows from the number of features; return the bytes of the block. */
static double gram_lay_out(hsep_gram *self, uint64_t n)
{
    double end = HSEP_WORDS(hsep_gram);
    self->n = n;
    self->rows = hsep_take(&end, HSEP_GRAM_TOGETHER * ((double)n + 1.0));
    self->sums = hsep_take(&end, hsep_triangle(n + 1));
    self->carries = hsep_take(&end, hsep_triangle(n + 1));
    return end * sizeof(double);
}

HSEP_API double hsep_gram_size(uint64_t n) { return gram_lay_out(&(hsep_gram){0}, n); }

HSEP_API void hsep_gram_init(hsep_gram *self, uint64_t n)
{
    memset(self, 0, (size_t)hsep_gram_size(n));
    (void)gram_lay_out(self, n);
}

HSEP_API int hsep_gram_valid(const void *block, uint64_t n)
{
    hsep_gram got;
    memcpy(&got, block, sizeof got);
    (void)gram_lay_out(&got, n); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 && got.waiting < HSEP_GRAM_TOGETHER;
}

HSEP_API double *hsep_gram_row(hsep_gram *self) { return hsep_at(self, self->rows) + (self->n + 1) * self->waiting; }

/* Add row a of the products of four rows, from its diagonal on, to the sums: with what rounding takes from them in the
 * carries, which is given back next time (Kahan 1965). */
static void gram_add_row(
    double *restrict sums, double *restrict carries, const double a[4], const double *restrict x0,
    const double *restrict x1, const double *restrict x2, const double *restrict x3, uint64_t n)
{
    const double a0 = a[0], a1 = a[1], a2 = a[2], a3 = a[3];
    uint64_t j = 0;
    for (; j + HSEP_LANES <= n; j += HSEP_LANES) {
        hsep_lanes *sum = hsep_lanes_at(sums + j), *carry = hsep_lanes_at(carries + j);
        const hsep_lanes before = *sum;
        const hsep_lanes change = ((a0 * *hsep_lanes_const(x0 + j) + a1 * *hsep_lanes_const(x1 + j)) +
                                   (a2 * *hsep_lanes_const(x2 + j) + a3 * *hsep_lanes_const(x3 + j))) +
                                  *carry;
        const hsep_lanes after = before + change;
        *carry = change - (after - before);
        *sum = after;
    }
    for (; j < n; j++) {
        const double before = sums[j];
        const double change = ((a0 * x0[j] + a1 * x1[j]) + (a2 * x2[j] + a3 * x3[j])) + carries[j];
        const double after = before + change;
        carries[j] = change - (after - before);
        sums[j] = after;
    }
}

/* Add the rows that wait. */
static void gram_add_waiting(hsep_gram *self)
{
    const uint64_t width = self->n + 1;
    double *x = hsep_at(self, self->rows), *sums = hsep_at(self, self->sums), *carries = hsep_at(self, self->carries);
    if (self->waiting == 0) {
        return;
    }
    memset(x + width * self->waiting, 0, (size_t)(width * (HSEP_GRAM_TOGETHER - self->waiting)) * sizeof(double));
    self->waiting = 0;
    for (uint64_t i = 0; i < width; i++, x++) {
        const uint64_t length = width - i;
        const double a[4] = {x[0], x[width], x[2 * width], x[3 * width]};
        gram_add_row(sums, carries, a, x, x + width, x + 2 * width, x + 3 * width, length);
        sums += length;
        carries += length;
    }
}

HSEP_API void hsep_gram_fold(hsep_gram *self)
{
    if (++self->waiting == HSEP_GRAM_TOGETHER) {
        gram_add_waiting(self);
    }
}

HSEP_API int hsep_gram_load(hsep_gram *self, uint64_t i)
{
    const uint64_t n = self->n;
    double *row = hsep_gram_row(self);
    for (uint64_t j = 0; j <= n - i; j++) {
        if (!isfinite(row[j])) {
            return 0;
        }
    }
    if (i < n && row[0] == 0.0) {
        return 0;
    }
    memmove(row + i, row, (size_t)(n + 1 - i) * sizeof(double));
    memset(row, 0, (size_t)i * sizeof(double));
    hsep_gram_fold(self);
    if (i == n) {
        gram_add_waiting(self);
    }
    return 1;
}

HSEP_API void hsep_gram_add(hsep_gram *self, hsep_gram *other, double weight)
{
    const uint64_t count = (uint64_t)hsep_triangle(self->n + 1);
    gram_add_waiting(self);
    gram_add_waiting(other);
    hsep_axpy(hsep_at(self, self->sums), weight, hsep_at(other, other->sums), count);
    hsep_axpy(hsep_at(self, self->carries), weight, hsep_at(other, other->carries), count);
}

HSEP_API void hsep_gram_discount(hsep_gram *self, double weight)
{
    double *sums = hsep_at(self, self->sums);
    gram_add_waiting(self);
    for (uint64_t i = 0; i < 2 * (uint64_t)hsep_triangle(self->n + 1); i++) { /* carries are behind the sums */
        sums[i] *= weight;
    }
}

HSEP_API void hsep_gram_settle(hsep_gram *self) { gram_add_waiting(self); }

HSEP_API double hsep_gram_square(const hsep_gram *self)
{
    const uint64_t n = self->n;
    const double *target = hsep_at_const(self, self->rows) + n;
    double square = hsep_at_const(self, self->sums)[(uint64_t)hsep_triangle(n + 1) - 1];
    for (uint64_t b = 0; b < self->waiting; b++, target += n + 1) {
        square += *target * *target;
    }
    return square;
}

/* The triangle of the first m features with the target beside them: the target is the column behind the features, whose
 * last row is its square. other: NULL, or added with its weight. */
static void gram_copy(
    const hsep_gram *self, const hsep_gram *other, double weight, const double penalties[], uint64_t m, double to[])
{
    const uint64_t n = self->n;
    const double *sums = hsep_at_const(self, self->sums), *rows = hsep_at_const(self, self->rows);
    const double *others = other != NULL ? hsep_at_const(other, other->sums) : NULL;
    for (uint64_t i = 0; i < m; i++) {
        memcpy(to, sums, (size_t)(m - i) * sizeof(double));
        to[m - i] = sums[n - i];
        if (others != NULL) {
            hsep_axpy(to, weight, others, m - i);
            to[m - i] += weight * others[n - i];
            others += n + 1 - i;
        }
        for (uint64_t b = 0; b < self->waiting; b++) {
            const double *row = rows + (n + 1) * b;
            hsep_axpy(to, row[i], row + i, m - i);
            to[m - i] += row[i] * row[n];
        }
        to[0] += penalties[i];
        to += m + 1 - i;
        sums += n + 1 - i;
    }
}

HSEP_API double hsep_gram_solve(
    const hsep_gram *self, const hsep_gram *other, double weight, const double penalties[], uint64_t m, double factor[],
    double least[], double w[])
{
    const double square = hsep_gram_square(self) + (other != NULL ? weight * hsep_gram_square(other) : 0.0);
    double *row = factor + (uint64_t)hsep_triangle(m + 1) - 1;
    gram_copy(self, other, weight, penalties, m, factor);
    for (uint64_t i = 0; i < m; i++) {
        least[i] = penalties[i] > gram_least ? penalties[i] : gram_least;
    }
    row[0] = square;
    least[m] = fmax(gram_of_target * square, gram_least);
    (void)hsep_cholesky_factor(factor, m + 1, least); /* no pivot is 0 */
    double sum = row[0] * row[0];                     /* sum of the squares, and of the penalties */
    for (uint64_t i = m; i-- > 0;) {                  /* R w = z */
        row -= m + 1 - i;
        w[i] = (row[m - i] - hsep_dot(row + 1, w + i + 1, m - i - 1)) / row[0];
        sum -= penalties[i] * w[i] * w[i];
    }
    return fmax(sum, 0.0);
}

/* x_j -= y_0 r_0j + y_1 r_1j + y_2 r_2j + y_3 r_3j for the entries j behind four, of HSEP_GRAM_ABREAST rows side by
 * side. r: four rows of R. */
static void gram_take(double *restrict x, const double y[4 * HSEP_GRAM_ABREAST], const double *const r[4], uint64_t n)
{
    const double *r0 = r[0], *r1 = r[1], *r2 = r[2], *r3 = r[3];
    hsep_lanes at[4 * HSEP_OF_FOUR];
    memcpy(at, y, sizeof at);
    for (uint64_t j = 0; j < n; j++, x += HSEP_GRAM_ABREAST) {
        hsep_lanes *to = hsep_lanes_at(x);
        for (int l = 0; l < HSEP_OF_FOUR; l++) {
            to[l] -= (r0[j] * at[l] + r1[j] * at[HSEP_OF_FOUR + l]) +
                     (r2[j] * at[2 * HSEP_OF_FOUR + l] + r3[j] * at[3 * HSEP_OF_FOUR + l]);
        }
    }
}

HSEP_API void hsep_gram_leverages(const double factor[], uint64_t m, double rows[], double leverages[HSEP_GRAM_ABREAST])
{
    hsep_lanes sums[HSEP_OF_FOUR];
    const double *row = factor;
    memset(leverages, 0, HSEP_GRAM_ABREAST * sizeof *leverages);
    memcpy(sums, leverages, sizeof sums);
    /* R' y = phi from the first feature to the last, which takes each of them from the entries behind it. */
    for (uint64_t first = 0; first < m; first += 4) {
        const uint64_t left = m - first, height = left < 4 ? left : 4;
        double *x = rows + HSEP_GRAM_ABREAST * first;
        const double *r[4] = {NULL};
        for (uint64_t i = 0; i < height; i++) {
            hsep_lanes *y = hsep_lanes_at(x) + HSEP_OF_FOUR * i;
            const double inverse = 1.0 / row[0];
            for (int l = 0; l < HSEP_OF_FOUR; l++) {
                y[l] *= inverse;
                sums[l] += y[l] * y[l];
            }
            for (uint64_t j = 1; i + j < height; j++) {
                for (int l = 0; l < HSEP_OF_FOUR; l++) {
                    y[HSEP_OF_FOUR * j + (uint64_t)l] -= row[j] * y[l];
                }
            }
            r[i] = row + (height - i);
            row += m + 1 - (first + i);
        }
        if (left > 4) {
            gram_take(x + 4 * HSEP_GRAM_ABREAST, x, r, left - 4);
        }
    }
    memcpy(leverages, sums, sizeof sums);
}

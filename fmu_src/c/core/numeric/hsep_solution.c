#include "hsep_solution.h"

#include "hsep_cholesky.h"
#include "hsep_math.h"
#include "hsep_vector.h"

#include <stddef.h>
#include <string.h>

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real solution_lay_out(hsep_solution *self, hsep_word n_head, hsep_word n_tail, hsep_word room)
{
    const hsep_real n = (hsep_real)n_head + (hsep_real)n_tail;
    hsep_real end = HSEP_WORDS(hsep_solution);
    self->n_head = n_head;
    self->n_tail = n_tail;
    self->room = room;
    self->penalties = hsep_take(&end, n);
    self->weights = hsep_take(&end, n);
    self->factor = hsep_take(&end, hsep_triangle(n_head + n_tail + 1));
    self->left = hsep_take(&end, hsep_triangle(n_tail + 1));
    self->least = hsep_take(&end, n + 1.0);
    self->rows = hsep_take(&end, (hsep_real)room * (n + 1.0));
    self->work = hsep_take(&end, HSEP_SOLUTION_ABREAST * (n + 1.0));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_solution_size(hsep_word n_head, hsep_word n_tail, hsep_word room)
{
    return solution_lay_out(&(hsep_solution){0}, n_head, n_tail, room);
}

HSEP_API void hsep_solution_init(hsep_solution *self, hsep_word n_head, hsep_word n_tail, hsep_word room)
{
    memset(self, 0, (size_t)hsep_solution_size(n_head, n_tail, room));
    (void)solution_lay_out(self, n_head, n_tail, room);
}

HSEP_API int hsep_solution_valid(const void *block, hsep_word n_head, hsep_word n_tail, hsep_word room)
{
    hsep_solution got;
    return HSEP_LAID_OUT(got, block, solution_lay_out(&got, n_head, n_tail, room)) && got.factored <= got.n_head &&
           got.waiting <= got.room && got.finished <= 1;
}

/* The rows of the factor behind the head. */
static hsep_real *solution_tail(hsep_solution *self)
{
    const hsep_real before = hsep_triangle(self->n_head + self->n_tail + 1) - hsep_triangle(self->n_tail + 1);
    return hsep_at(self, self->factor) + (hsep_word)before;
}

/* Add a Gram matrix to the factor's triangle, in its order. */
static void solution_add(hsep_solution *self, const hsep_gram *gram, hsep_real weight)
{
    const hsep_word n_head = self->n_head, n_tail = self->n_tail, n = gram->n;
    const hsep_real *row = hsep_at_const(gram, gram->sums); /* row i of the triangle, from its diagonal on */
    hsep_real *factor = hsep_at(self, self->factor), *tail = solution_tail(self);
    for (hsep_word i = 0; i < n_tail; i++, row += n + 1 - (i - 1)) {
        hsep_real *to = factor + n_head + i;
        for (hsep_word j = 0; j < n_head; j++) {
            *to += weight * row[n_tail + (n_head - 1 - j) - i];
            to += n_head + n_tail - j;
        }
        hsep_axpy(tail, weight, row, n_tail - i);
        tail[n_tail - i] += weight * row[n - i];
        tail += n_tail + 1 - i;
    }
    for (hsep_word i = 0; i < n_head; i++) { /* a row of the Gram matrix is a column of the factor, upwards */
        hsep_real *to = factor + (n_head - 1 - i);
        for (hsep_word j = 0; j < n_head - i; j++) {
            *to += weight * row[n_head - i - 1 - j];
            to += n_head + n_tail - j;
        }
        to = factor + n_head + n_tail;
        for (hsep_word j = 0; j < n_head - 1 - i; j++) {
            to += n_head + n_tail - j;
        }
        *to += weight * row[n - n_tail - i];
        row += n - n_tail + 1 - i;
    }
    *tail += weight * hsep_gram_square(gram);
    self->square += weight * hsep_gram_square(gram);
}

HSEP_API void hsep_solution_begin(hsep_solution *self, const hsep_gram *gram, const hsep_gram *other, hsep_real weight)
{
    const hsep_word n_head = self->n_head, n = n_head + self->n_tail;
    const hsep_real *penalties = hsep_at(self, self->penalties) + self->n_tail;
    hsep_real *diagonal = hsep_at(self, self->factor), *least = hsep_at(self, self->least);
    self->factored = self->waiting = self->finished = 0;
    self->square = 0.0;
    memset(diagonal, 0, (size_t)hsep_triangle(n + 1) * sizeof(hsep_real));
    solution_add(self, gram, 1.0);
    if (other != NULL) {
        solution_add(self, other, weight);
    }
    for (hsep_word i = 0; i < n_head; i++) {
        const hsep_real penalty = penalties[n_head - 1 - i];
        *diagonal += penalty;
        diagonal += n + 1 - i;
        least[i] = penalty > HSEP_SOLUTION_LEAST ? penalty : HSEP_SOLUTION_LEAST;
    }
}

HSEP_API void hsep_solution_row(hsep_solution *self, const hsep_real row[], hsep_real target)
{
    const hsep_word n_head = self->n_head, n_tail = self->n_tail, n = n_head + n_tail;
    hsep_real *to = hsep_at(self, self->rows) + self->waiting * (n + 1);
    if (self->waiting == self->room) { /* of a state that was changed on purpose */
        return;
    }
    for (hsep_word i = 0; i < n_head; i++) {
        to[i] = row[n_tail + n_head - 1 - i];
    }
    memcpy(to + n_head, row, (size_t)n_tail * sizeof(hsep_real));
    to[n] = target;
    self->square += target * target;
    self->waiting++;
}

HSEP_API hsep_real hsep_solution_left(const hsep_solution *self)
{
    const hsep_real all = (hsep_real)(self->n_head + self->n_tail + 1 - self->factored);
    const hsep_real tail = (hsep_real)self->n_tail + 1.0;
    return (all * all * all - tail * tail * tail) / 6.0;
}

/* Take in the last rows that wait: four, with rows of 0 in their place if there are fewer, or one. */
static void solution_take_in(hsep_solution *self)
{
    const hsep_word width = self->n_head + self->n_tail + 1;
    const hsep_word count = self->waiting < HSEP_SOLUTION_ABREAST ? self->waiting : HSEP_SOLUTION_ABREAST;
    hsep_real *work = hsep_at(self, self->work);
    self->waiting -= count;
    memcpy(work, hsep_at(self, self->rows) + width * self->waiting, (size_t)(width * count) * sizeof(hsep_real));
    if (count > 1) {
        memset(work + width * count, 0, (size_t)(width * (HSEP_SOLUTION_ABREAST - count)) * sizeof(hsep_real));
        hsep_cholesky_take_four(hsep_at(self, self->factor), width, self->n_head, work);
    } else if (count == 1) {
        hsep_cholesky_take_one(hsep_at(self, self->factor), width, self->n_head, work);
    }
}

HSEP_API hsep_real hsep_solution_advance(hsep_solution *self, hsep_real amount, int all)
{
    const hsep_word width = self->n_head + self->n_tail + 1;
    while (self->factored < self->n_head && amount > 0.0) {
        const hsep_real height = (hsep_real)(width - self->factored);
        const hsep_word left = self->n_head - self->factored;
        const hsep_word count = left < HSEP_CHOLESKY_PANEL ? left : HSEP_CHOLESKY_PANEL;
        (void)hsep_cholesky_rows( /* no pivot is 0 */
            hsep_at(self, self->factor), width, self->factored, self->factored + count, hsep_at(self, self->least));
        self->factored += count;
        amount -= 0.5 * (hsep_real)HSEP_CHOLESKY_PANEL * height * height;
        all = 0;
    }
    if (self->factored == self->n_head && (all || self->waiting >= HSEP_SOLUTION_ABREAST)) {
        solution_take_in(self);
    }
    return amount;
}

HSEP_API hsep_real hsep_solution_finish(hsep_solution *self)
{
    const hsep_word n_head = self->n_head, n_tail = self->n_tail, n = n_head + n_tail;
    const hsep_real *penalties = hsep_at(self, self->penalties);
    hsep_real *tail = solution_tail(self), *left = hsep_at(self, self->left), *w = hsep_at(self, self->weights);
    hsep_real *least = hsep_at(self, self->least), *diagonal = tail, *row = hsep_at(self, self->factor);
    if (!self->finished) {
        (void)hsep_solution_advance(self, INFINITY, 0);
        while (self->waiting > 0) {
            solution_take_in(self);
        }
        memcpy(left, tail, (size_t)hsep_triangle(n_tail + 1) * sizeof(hsep_real));
        self->finished = 1;
    } else {
        memcpy(tail, left, (size_t)hsep_triangle(n_tail + 1) * sizeof(hsep_real));
    }
    for (hsep_word i = 0; i < n_tail; i++) {
        *diagonal += penalties[i];
        diagonal += n_tail + 1 - i;
        least[n_head + i] = penalties[i] > HSEP_SOLUTION_LEAST ? penalties[i] : HSEP_SOLUTION_LEAST;
    }
    least[n] = hsep_fmax(HSEP_SOLUTION_OF_TARGET * self->square, HSEP_SOLUTION_LEAST);
    (void)hsep_cholesky_rows(tail, n_tail + 1, 0, n_tail + 1, least + n_head);
    hsep_real *x = hsep_at(self, self->work), sum = *diagonal * *diagonal;
    row += (hsep_word)hsep_triangle(n + 1) - 1;
    for (hsep_word i = n; i-- > 0;) { /* R x = z */
        row -= n + 1 - i;
        x[i] = (row[n - i] - hsep_dot(row + 1, x + i + 1, n - i - 1)) / row[0];
    }
    memcpy(w, x + n_head, (size_t)n_tail * sizeof(hsep_real));
    for (hsep_word i = 0; i < n_head; i++) {
        w[n_tail + i] = x[n_head - 1 - i];
    }
    for (hsep_word i = 0; i < n; i++) { /* sum of the squares, and of the penalties */
        sum -= penalties[i] * w[i] * w[i];
    }
    return hsep_fmax(sum, 0.0);
}

/* x_j -= y_0 r_0j + y_1 r_1j + y_2 r_2j + y_3 r_3j for the entries j behind four, of HSEP_SOLUTION_ABREAST rows side by
 * side, the first vectors of them. r: four rows of R. */
static inline void solution_take(
    hsep_real *restrict x, const hsep_lanes at[4 * HSEP_OF_FOUR], const hsep_real *const r[4], hsep_word n, int vectors)
{
    const hsep_real *r0 = r[0], *r1 = r[1], *r2 = r[2], *r3 = r[3];
    for (hsep_word j = 0; j < n; j++, x += HSEP_SOLUTION_ABREAST) {
        hsep_lanes *to = hsep_lanes_at(x);
        for (int l = 0; l < vectors; l++) {
            to[l] -= (r0[j] * at[l] + r1[j] * at[HSEP_OF_FOUR + l]) +
                     (r2[j] * at[2 * HSEP_OF_FOUR + l] + r3[j] * at[3 * HSEP_OF_FOUR + l]);
        }
    }
}

/* The leverages of the first vectors of the rows. */
static inline void solution_leverages(hsep_solution *self, hsep_lanes sums[HSEP_OF_FOUR], int vectors)
{
    const hsep_word m = self->n_head + self->n_tail;
    const hsep_real *row = hsep_at(self, self->factor);
    hsep_real *rows = hsep_at(self, self->work);
    /* R' y = phi from the first feature to the last, which takes each of them from the entries behind it. */
    for (hsep_word first = 0; first < m; first += 4) {
        const hsep_word left = m - first, height = left < 4 ? left : 4;
        hsep_real *x = rows + HSEP_SOLUTION_ABREAST * first;
        const hsep_real *r[4] = {NULL};
        for (hsep_word i = 0; i < height; i++) {
            hsep_lanes *y = hsep_lanes_at(x) + HSEP_OF_FOUR * i;
            const hsep_real inverse = 1.0 / row[0];
            for (int l = 0; l < vectors; l++) {
                y[l] *= inverse;
                sums[l] += y[l] * y[l];
            }
            for (hsep_word j = 1; i + j < height; j++) {
                for (int l = 0; l < vectors; l++) {
                    y[HSEP_OF_FOUR * j + (hsep_word)l] -= row[j] * y[l];
                }
            }
            r[i] = row + (height - i);
            row += m + 1 - (first + i);
        }
        if (left > 4) {
            hsep_lanes at[4 * HSEP_OF_FOUR];
            memcpy(at, x, sizeof at);
            solution_take(x + 4 * HSEP_SOLUTION_ABREAST, at, r, left - 4, vectors);
        }
    }
}

HSEP_API void hsep_solution_leverages(hsep_solution *self, hsep_word count, hsep_real leverages[HSEP_SOLUTION_ABREAST])
{
    hsep_lanes sums[HSEP_OF_FOUR];
    memset(sums, 0, sizeof sums);
    if (count > 1) {
        solution_leverages(self, sums, HSEP_OF_FOUR);
    } else {
        solution_leverages(self, sums, 1);
    }
    memcpy(leverages, sums, sizeof sums);
}

#include "hsep_solution.h"

#include "hsep_cholesky.h"

static hsep_real solution_lay_out(hsep_solution *self, hsep_int n_head, hsep_int n_tail, hsep_int room)
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
    self->abreast = hsep_take(&end, HSEP_SOLUTION_ABREAST * (n + 1.0));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_solution_size(hsep_int n_head, hsep_int n_tail, hsep_int room)
{
    return solution_lay_out(&(hsep_solution){0}, n_head, n_tail, room);
}

HSEP_API void hsep_solution_init(hsep_solution *self, hsep_int n_head, hsep_int n_tail, hsep_int room)
{
    memset(self, 0, (size_t)hsep_solution_size(n_head, n_tail, room));
    (void)solution_lay_out(self, n_head, n_tail, room);
}

/* The rows of the factor after the head. */
static hsep_real *solution_tail(hsep_solution *self)
{
    const hsep_real before = hsep_triangle(self->n_head + self->n_tail + 1) - hsep_triangle(self->n_tail + 1);
    return hsep_at(self, self->factor) + (hsep_int)before;
}

/* Add the rows of a Gram matrix that do not wait to the factor's triangle. */
static void solution_add(hsep_solution *self, const hsep_gram *gram, hsep_real weight)
{
    const hsep_int count = (hsep_int)hsep_triangle(self->n_head + self->n_tail + 1);
    const hsep_real *end = hsep_at_const(gram, gram->sums) + (hsep_int)hsep_triangle(gram->n + 1);
    hsep_axpy(hsep_at(self, self->factor), weight, end - count, count);
    self->square += weight * end[-1];
}

HSEP_API void hsep_solution_reset(hsep_solution *self)
{
    self->begun = self->factored = self->waiting = self->finished = 0;
}

HSEP_API void hsep_solution_begin(hsep_solution *self, const hsep_gram *gram, const hsep_gram *other, hsep_real weight)
{
    const hsep_int n_head = self->n_head, n = n_head + self->n_tail;
    const hsep_real *penalties = hsep_at(self, self->penalties) + self->n_tail;
    hsep_real *diagonal = hsep_at(self, self->factor), *least = hsep_at(self, self->least);
    hsep_solution_reset(self);
    self->begun = 1;
    self->square = 0.0;
    hsep_zero(diagonal, (hsep_int)hsep_triangle(n + 1));
    solution_add(self, gram, 1.0);
    if (other != NULL) {
        solution_add(self, other, weight);
    }
    for (hsep_int i = 0; i < n_head; i++) {
        const hsep_real penalty = penalties[n_head - 1 - i];
        *diagonal += penalty;
        diagonal += n + 1 - i;
        least[i] = penalty > HSEP_SOLUTION_LEAST ? penalty : HSEP_SOLUTION_LEAST;
    }
    for (hsep_int b = 0; b < gram->waiting; b++) {
        hsep_solution_row(self, hsep_at_const(gram, gram->rows) + b * (gram->n + 1), gram->n);
    }
}

HSEP_API void hsep_solution_row(hsep_solution *self, const hsep_real row[], hsep_int n)
{
    const hsep_int width = self->n_head + self->n_tail + 1;
    if (self->waiting == self->room) { /* of a state that was changed on purpose */
        return;
    }
    hsep_copy(hsep_at(self, self->rows) + self->waiting * width, row + (n + 1 - width), width);
    self->square += row[n] * row[n];
    self->waiting++;
}

/* Multiply-adds of a row that is taken in where this many rows of the head are factored. */
static hsep_real solution_of_row(const hsep_solution *self, hsep_int factored)
{
    const hsep_real all = (hsep_real)(self->n_head + self->n_tail + 1), left = all - (hsep_real)factored;
    return all * all - 0.5 * left * left;
}

HSEP_API hsep_real hsep_solution_left(const hsep_solution *self, hsep_int to_come)
{
    const hsep_real all = (hsep_real)(self->n_head + self->n_tail + 1 - self->factored);
    const hsep_real after = (hsep_real)self->n_tail + 1.0;
    const hsep_real rows = (hsep_real)(self->waiting + to_come);
    return (all * all * all - after * after * after) / 6.0 + rows * solution_of_row(self, self->n_head);
}

HSEP_API hsep_real hsep_solution_advance(hsep_solution *self, hsep_real amount, int all)
{
    const hsep_int width = self->n_head + self->n_tail + 1;
    hsep_real *factor = hsep_at(self, self->factor), *work = hsep_at(self, self->work);
    while (all || amount > 0.0) {
        const hsep_int left = self->n_head - self->factored, waiting = self->waiting;
        if (waiting >= HSEP_SOLUTION_ABREAST || (all && left == 0 && waiting > 0)) {
            const hsep_int count = hsep_min(waiting, HSEP_SOLUTION_ABREAST);
            amount -= (hsep_real)count * solution_of_row(self, self->factored);
            self->waiting -= count;
            hsep_copy(work, hsep_at(self, self->rows) + width * self->waiting, width * count);
            if (count > 1) { /* with rows of 0 in the place of those that are not there */
                hsep_zero(work + width * count, width * (HSEP_SOLUTION_ABREAST - count));
                hsep_cholesky_take_four(factor, width, self->factored, work);
            } else {
                hsep_cholesky_take_one(factor, width, self->factored, work);
            }
        } else if (left > 0) {
            const hsep_int count = hsep_min(left, HSEP_CHOLESKY_PANEL);
            const hsep_int last = self->factored + count;
            const hsep_real height = (hsep_real)(width - self->factored);
            /* no pivot is 0 */
            (void)hsep_cholesky_rows(factor, width, self->factored, last, hsep_at(self, self->least));
            self->factored = last;
            amount -= 0.5 * (hsep_real)count * height * height;
        } else {
            break;
        }
    }
    return amount;
}

/* Take in all rows that have come, and factor the tail with its penalties. */
static void solution_complete(hsep_solution *self)
{
    const hsep_int n_head = self->n_head, n_tail = self->n_tail;
    const hsep_int size = (hsep_int)hsep_triangle(n_tail + 1);
    const hsep_real *penalties = hsep_at(self, self->penalties);
    hsep_real *tail = solution_tail(self), *left = hsep_at(self, self->left), *diagonal = tail;
    hsep_real *least = hsep_at(self, self->least) + n_head;
    if (!self->finished) {
        (void)hsep_solution_advance(self, 0.0, 1);
        hsep_copy(left, tail, size);
    } else {
        hsep_copy(tail, left, size);
    }
    for (hsep_int i = 0; i < n_tail; i++) {
        *diagonal += penalties[i];
        diagonal += n_tail + 1 - i;
        least[i] = penalties[i] > HSEP_SOLUTION_LEAST ? penalties[i] : HSEP_SOLUTION_LEAST;
    }
    least[n_tail] = hsep_fmax(HSEP_SOLUTION_OF_TARGET * self->square, HSEP_SOLUTION_LEAST);
    (void)hsep_cholesky_rows(tail, n_tail + 1, 0, n_tail + 1, least);
    self->finished = 1;
}

HSEP_API hsep_real hsep_solution_finish(hsep_solution *self)
{
    const hsep_int n_head = self->n_head, n_tail = self->n_tail, n = n_head + n_tail;
    const hsep_real *penalties = hsep_at(self, self->penalties), *row = hsep_at(self, self->factor);
    hsep_real *w = hsep_at(self, self->weights), *x = hsep_at(self, self->work);
    solution_complete(self);
    for (hsep_int i = 0; i < n; i++) { /* R x = z */
        x[i] = row[n - i];
        row += n + 1 - i;
    }
    hsep_real sum = *row * *row;
    hsep_cholesky_backward(hsep_at(self, self->factor), n + 1, n, x);
    hsep_copy(w, x + n_head, n_tail);
    for (hsep_int i = 0; i < n_head; i++) {
        w[n_tail + i] = x[n_head - 1 - i];
    }
    for (hsep_int i = 0; i < n; i++) { /* sum of the squares, and of the penalties */
        sum -= penalties[i] * w[i] * w[i];
    }
    return hsep_fmax(sum, 0.0);
}

#if HSEP_LANES == 2
/* R'^-1 of four rows side by side, which are changed in place; to the bit as hsep_cholesky_forward has each. */
static void solution_forward_abreast(hsep_solution *self)
{
    const hsep_int m = self->n_head + self->n_tail;
    const hsep_real *row = hsep_at(self, self->factor);
    hsep_lanes *y = hsep_lanes_at(hsep_at(self, self->abreast));
    for (hsep_int first = 0; first < m; first += 4) {
        const hsep_int left = m - first, height = hsep_min(left, 4);
        const hsep_real *r[4] = {NULL};
        hsep_lanes a[4], b[4]; /* two rows each */
        for (hsep_int i = 0; i < height; i++, y += 2) {
            a[i] = y[0] /= row[0];
            b[i] = y[1] /= row[0];
            for (hsep_int j = 1; i + j < height; j++) {
                y[2 * j] -= row[j] * a[i];
                y[2 * j + 1] -= row[j] * b[i];
            }
            r[i] = row + (height - i);
            row += left + 1 - i;
        }
        const hsep_real *r0 = r[0], *r1 = r[1], *r2 = r[2], *r3 = r[3];
        for (hsep_int j = 0; j + 4 < left; j++) { /* an entry of the factor is loaded once for all rows */
            hsep_lanes *to = y + 2 * j, u = to[0] - r0[j] * a[0], v = to[1] - r0[j] * b[0];
            u -= r1[j] * a[1], v -= r1[j] * b[1];
            u -= r2[j] * a[2], v -= r2[j] * b[2];
            to[0] = u - r3[j] * a[3], to[1] = v - r3[j] * b[3];
        }
    }
}

/* The leverages of four rows side by side. */
static void solution_leverages_abreast(hsep_solution *self, hsep_int count, hsep_real leverages[HSEP_SOLUTION_ABREAST])
{
    const hsep_int m = self->n_head + self->n_tail;
    const hsep_real *r0 = hsep_at(self, self->work), *r1 = r0 + (m + 1); /* what is beyond the count is a copy */
    const hsep_real *r2 = count > 2 ? r1 + (m + 1) : r1, *r3 = count > 3 ? r2 + (m + 1) : r2;
    hsep_real *to = hsep_at(self, self->abreast);
    const hsep_lanes *x = hsep_lanes_at(to);
    hsep_lanes sums[HSEP_OF_FOUR];
    for (hsep_int i = 0; i < m; i++, to += HSEP_SOLUTION_ABREAST) {
        to[0] = r0[i], to[1] = r1[i], to[2] = r2[i], to[3] = r3[i];
    }
    solution_forward_abreast(self);
    for (hsep_int l = 0; l < HSEP_OF_FOUR; l++, x++) { /* as hsep_dot has each; a sum with a name has a register */
        hsep_lanes s0 = {0.0}, s1 = s0, s2 = s0, s3 = s0;
        const hsep_lanes *at = x;
        hsep_int i = 0;
        for (; i + 4 <= m; i += 4, at += 4 * HSEP_OF_FOUR) {
            s0 += at[0] * at[0];
            s1 += at[HSEP_OF_FOUR] * at[HSEP_OF_FOUR];
            s2 += at[2 * HSEP_OF_FOUR] * at[2 * HSEP_OF_FOUR];
            s3 += at[3 * HSEP_OF_FOUR] * at[3 * HSEP_OF_FOUR];
        }
        for (; i < m; i++, at += HSEP_OF_FOUR) {
            s0 += *at * *at;
        }
        sums[l] = (s0 + s1) + (s2 + s3);
    }
    memcpy(leverages, sums, sizeof sums);
}
#endif

HSEP_API void hsep_solution_leverages(hsep_solution *self, hsep_int count, hsep_real leverages[HSEP_SOLUTION_ABREAST])
{
    const hsep_int m = self->n_head + self->n_tail;
#if HSEP_LANES == 2
    if (count > 1) {
        solution_leverages_abreast(self, count, leverages);
        return;
    }
#endif
    for (hsep_int c = 0; c < count; c++) {
        hsep_real *y = hsep_at(self, self->work) + (m + 1) * c;
        y[m] = 0.0;
        hsep_cholesky_forward(hsep_at(self, self->factor), m + 1, m, y);
        leverages[c] = hsep_dot(y, y, m);
    }
}

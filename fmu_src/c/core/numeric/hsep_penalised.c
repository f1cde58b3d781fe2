#include "hsep_penalised.h"

#include "hsep_block_fold.h"
#include "hsep_tiles.h"
#include "hsep_wide.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Copy the rows and columns of the first features, as many as to has, with the target beside them. */
static void penalised_copy_leading(const hsep_regression *self, hsep_regression *to)
{
    const uint64_t n = to->n, all = self->n_tiles, kept = to->n_tiles;
    const double *from = hsep_at_const(self, self->tiles);
    double *tile = hsep_at(to, to->tiles);
    memcpy(hsep_at(to, to->inverse_d), hsep_at_const(self, self->inverse_d), (size_t)n * sizeof(double));
    for (uint64_t band = 0; band < kept; band++) { /* a row of tiles has those from the diagonal on */
        memcpy(tile, from, (size_t)(HSEP_TILE_STRIDE * (kept - band)) * sizeof(double));
        from += HSEP_TILE_STRIDE * (all - band);
        tile += HSEP_TILE_STRIDE * (kept - band);
    }
    for (uint64_t i = 0; i < n; i++) {
        *hsep_regression_entry(to, i, n) = *hsep_regression_entry_const(self, i, self->n);
        for (uint64_t j = n + 1; j < HSEP_TILE * kept; j++) {
            *hsep_regression_entry(to, i, j) = 0.0;
        }
    }
}

/* product := U w, (n,), with w, (4 n_tiles,), 0 behind the features. */
static void penalised_multiply(const hsep_regression *self, const double w[], double product[])
{
    const double *tile = hsep_at_const(self, self->tiles);
    for (uint64_t first = 0; first < self->n; first += HSEP_TILE) {
        double sum[HSEP_TILE] = {0.0};
        for (uint64_t j = first; j < HSEP_TILE * self->n_tiles; j += HSEP_TILE, tile += HSEP_TILE_STRIDE) {
            for (unsigned r = 0; r < HSEP_TILE; r++) {
                const double *t = tile + HSEP_TILE * r;
                sum[r] += (t[0] * w[j] + t[1] * w[j + 1]) + (t[2] * w[j + 2] + t[3] * w[j + 3]);
            }
        }
        for (uint64_t r = 0; r < HSEP_TILE && first + r < self->n; r++) {
            product[first + r] = sum[r];
        }
    }
}

/* Whether wide vectors are worth it for a triangle of n features. */
static int penalised_is_wide(uint64_t n) { return hsep_is_wide((double)n * (double)n * (double)n / 6.0); }

HSEP_API void hsep_penalised_add(hsep_regression *self, const hsep_regression *other, double weight, double work[])
{
    const double *inverse_d = hsep_at_const(other, other->inverse_d);
    for (uint64_t i = 0; i < other->n; i++) {
        const double scale = sqrt(weight / inverse_d[i]);
        double *row = hsep_block_fold_row(work, other->n, i);
        row[i] = scale;
        for (uint64_t j = i + 1; j <= other->n; j++) {
            row[j] = scale * *hsep_regression_entry_const(other, i, j);
        }
    }
    hsep_block_fold(self, work, other->n, 1, penalised_is_wide(other->n));
    self->residual_sum += weight * other->residual_sum;
}

HSEP_API double hsep_penalised_solve(
    const hsep_regression *self, const double penalties[], hsep_regression *solved, double w[], double work[])
{
    const uint64_t n = self->n, m = solved->n;
    const double *inverse_d = hsep_at_const(self, self->inverse_d);
    penalised_copy_leading(self, solved);
    for (uint64_t i = 0; i < m; i++) {
        hsep_block_fold_row(work, m, i)[i] = sqrt(penalties[i]);
    }
    hsep_block_fold(solved, work, m, 1, penalised_is_wide(m));
    hsep_regression_solve(solved, w);
    double sum = self->residual_sum, *padded = work, *product = work + HSEP_TILE * self->n_tiles;
    memset(padded, 0, (size_t)(HSEP_TILE * self->n_tiles) * sizeof(double));
    memcpy(padded, w, (size_t)m * sizeof(double));
    penalised_multiply(self, padded, product);
    for (uint64_t i = 0; i < n; i++) { /* [R z; 0 rho] [-w; 1], row after row */
        const double residual = *hsep_regression_entry_const(self, i, n) - product[i];
        sum += residual * residual / inverse_d[i];
    }
    return sum;
}

HSEP_INLINE double penalised_leverage(hsep_regression *self)
{
    const double *inverse_d = hsep_at(self, self->inverse_d), *tile = hsep_at(self, self->tiles);
    double *x = hsep_regression_row(self), sum = 0.0;
    uint64_t rows = self->n;
    x[rows] = 0.0;
    /* U' y = phi from the first feature to the last, which takes each of them from the entries behind it. */
    for (uint64_t left = self->n_tiles; left > 0; left--, x += 4, inverse_d += 4) {
        const unsigned height = rows < HSEP_TILE ? (unsigned)rows : HSEP_TILE;
        rows -= height;
        for (unsigned r = 0; r < height; r++) {
            sum += x[r] * x[r] * inverse_d[r];
            for (unsigned c = r + 1; c < 4; c++) {
                x[c] -= x[r] * tile[4 * r + c];
            }
        }
        const double y0 = x[0], y1 = x[1], y2 = x[2], y3 = x[3];
        const double *t = tile + HSEP_TILE_STRIDE;
        for (double *to = x + 4; t < tile + HSEP_TILE_STRIDE * left; t += HSEP_TILE_STRIDE, to += 4) {
            for (unsigned c = 0; c < 4; c++) {
                to[c] -= (y0 * t[c] + y1 * t[4 + c]) + (y2 * t[8 + c] + y3 * t[12 + c]);
            }
        }
        tile += HSEP_TILE_STRIDE * left;
    }
    return sum;
}

HSEP_WIDE static double penalised_leverage_wide(hsep_regression *self) { return penalised_leverage(self); }

HSEP_API double hsep_penalised_leverage(hsep_regression *self, int wide)
{
    return wide ? penalised_leverage_wide(self) : penalised_leverage(self);
}

#include "hsep_penalised.h"

#include "hsep_tiles.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Copy the rows and columns of the first features, as many as to has, with the target beside them. */
static void penalised_copy_leading(const hsep_regression *self, hsep_regression *to)
{
    const uint64_t n = to->n;
    memcpy(hsep_at(to, to->inverse_d), hsep_at_const(self, self->inverse_d), (size_t)n * sizeof(double));
    for (uint64_t i = 0; i < n; i++) {
        for (uint64_t j = i + 1; j <= n; j++) {
            *hsep_tile_entry(to, i, j) = *hsep_tile_entry_const(self, i, j < n ? j : self->n);
        }
    }
}

HSEP_API double hsep_penalised_solve(
    const hsep_regression *self, const double penalties[], hsep_regression *solved, double w[])
{
    const uint64_t n = self->n, m = solved->n;
    const double *inverse_d = hsep_at_const(self, self->inverse_d);
    double *row = hsep_regression_row(solved);
    penalised_copy_leading(self, solved);
    for (uint64_t i = 0; i < m; i++) {
        const uint64_t first = i / HSEP_TILE;
        memset(row + HSEP_TILE * first, 0, (size_t)(m + 1 - HSEP_TILE * first) * sizeof(double));
        row[i] = sqrt(penalties[i]);
        hsep_regression_fold_once(solved, first);
    }
    hsep_regression_solve(solved, w);
    double sum = self->residual_sum;
    for (uint64_t i = 0; i < n; i++) { /* [R z; 0 rho] [-w; 1], row after row */
        double residual = *hsep_tile_entry_const(self, i, n) - (i < m ? w[i] : 0.0);
        for (uint64_t j = i + 1; j < m; j++) {
            residual -= *hsep_tile_entry_const(self, i, j) * w[j];
        }
        sum += residual * residual / inverse_d[i];
    }
    return sum;
}

HSEP_API double hsep_penalised_leverage(hsep_regression *self)
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

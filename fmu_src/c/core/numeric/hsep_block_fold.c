#include "hsep_block_fold.h"

#include "hsep_tiles.h"
#include "hsep_vector.h"
#include "hsep_wide.h"

#include <math.h>
#include <string.h>

/* Reflectors of 4 columns, and what they make of 4 rows of R = D^(1/2) U. */
typedef struct {
    double *v;                  /* (4, m) one after the other, from entry to entry of the rows */
    uint64_t m;                 /* rows that may differ from 0 */
    double T[4][4];             /* upper triangle */
    double root[4], inverse[4]; /* diagonal of R before, and reciprocals of it after, with its sign */
} block_reflectors;

/* Entries of a row, with those of its last tile that are 0. */
static uint64_t block_width(uint64_t n) { return HSEP_TILE * (n / HSEP_TILE + 1); }

HSEP_API double hsep_block_fold_size(uint64_t n, uint64_t count)
{
    const double width = HSEP_TILE * (double)(n / HSEP_TILE + 1);
    return width * (double)count + HSEP_TILE * (width + (double)count); /* rows, 4 of R, 4 columns of the rows */
}

HSEP_API double *hsep_block_fold_row(double work[], uint64_t n, uint64_t b)
{
    double *row = work + block_width(n) * b;
    memset(row, 0, (size_t)block_width(n) * sizeof(double));
    return row;
}

/* Reflect column r of a panel of 4, and those behind it; return tau, 0 if there is nothing to reflect. tile: on the
 * diagonal. */
HSEP_INLINE double block_reflect(block_reflectors *at, double *tile, double *inverse_d, unsigned r)
{
    double *x = at->v + r * at->m;
    const double root = 1.0 / sqrt(*inverse_d), sigma = hsep_dot(x, x, at->m);
    const double norm = sqrt(root * root + sigma), scale = 1.0 / (root + norm), tau = (norm + root) / norm;
    at->root[r] = root;
    at->inverse[r] = 1.0 / root;
    if (!(sigma > 0.0)) { /* or squares underflow */
        memset(x, 0, (size_t)at->m * sizeof(double));
        return 0.0;
    }
    at->inverse[r] = -1.0 / norm;
    *inverse_d = 1.0 / (norm * norm);
    for (uint64_t b = 0; b < at->m; b++) {
        x[b] *= scale;
    }
    for (unsigned c = r + 1; c < HSEP_TILE; c++) {
        double *other = at->v + c * at->m, *entry = tile + HSEP_TILE * r + c;
        const double s = tau * (root * *entry + hsep_dot(x, other, at->m));
        *entry = (root * *entry - s) * at->inverse[r];
        entry[HSEP_TILE_ENTRIES] = 0.0;
        hsep_axpy(other, -s, x, at->m);
    }
    return tau;
}

/* T of the reflectors' product: its column j is -tau_j T V' v_j above the diagonal. */
HSEP_INLINE void block_triangle(block_reflectors *at, const double tau[4])
{
    for (unsigned j = 0; j < HSEP_TILE; j++) {
        double products[HSEP_TILE] = {0.0};
        for (unsigned i = 0; i < j; i++) {
            products[i] = hsep_dot(at->v + i * at->m, at->v + j * at->m, at->m);
        }
        for (unsigned i = 0; i < j; i++) {
            double sum = 0.0;
            for (unsigned l = i; l < j; l++) {
                sum += at->T[i][l] * products[l];
            }
            at->T[i][j] = -tau[j] * sum;
        }
        at->T[j][j] = tau[j];
    }
}

/* W += V' X for the next 2 rows of X, x and y, with entries v and w of the reflectors; written out for compilers to
 * make vectors of it. */
HSEP_INLINE void block_add_two(
    double *restrict W, uint64_t width, const double *restrict x, const double *restrict y, const double v[4],
    const double w[4])
{
    double *restrict W1 = W + width, *restrict W2 = W1 + width, *restrict W3 = W2 + width;
    const double v0 = v[0], v1 = v[1], v2 = v[2], v3 = v[3], w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3];
    for (uint64_t j = 0; j < width; j++) {
        W[j] += v0 * x[j] + w0 * y[j];
        W1[j] += v1 * x[j] + w1 * y[j];
        W2[j] += v2 * x[j] + w2 * y[j];
        W3[j] += v3 * x[j] + w3 * y[j];
    }
}

/* x := x - V S for 2 rows of X, x and y, with entries v and w of the reflectors. */
HSEP_INLINE void block_subtract_two(
    double *restrict x, double *restrict y, const double *restrict S, uint64_t width, const double v[4],
    const double w[4])
{
    const double *restrict S1 = S + width, *restrict S2 = S1 + width, *restrict S3 = S2 + width;
    const double v0 = v[0], v1 = v[1], v2 = v[2], v3 = v[3], w0 = w[0], w1 = w[1], w2 = w[2], w3 = w[3];
    for (uint64_t j = 0; j < width; j++) {
        x[j] -= (v0 * S[j] + v1 * S1[j]) + (v2 * S2[j] + v3 * S3[j]);
        y[j] -= (w0 * S[j] + w1 * S1[j]) + (w2 * S2[j] + w3 * S3[j]);
    }
}

/* Entries b of the reflectors. */
HSEP_INLINE void block_entries(const block_reflectors *at, uint64_t b, double v[4])
{
    for (unsigned r = 0; r < HSEP_TILE; r++) {
        v[r] = at->v[r * at->m + b];
    }
}

/* S := T' W of W = R + V' X, and R := R - S. tile: of R, the first one; W: (4, width), V' X, which becomes S. */
HSEP_INLINE void block_turn(const block_reflectors *at, double *tile, double *W, uint64_t width)
{
    for (uint64_t j = 0; j < width; j += HSEP_TILE, tile += HSEP_TILE_STRIDE) {
        double w[HSEP_TILE][HSEP_TILE];
        for (unsigned r = 0; r < HSEP_TILE; r++) {
            double *entry = tile + HSEP_TILE * r, *s = W + r * width + j;
            for (unsigned c = 0; c < HSEP_TILE; c++) {
                entry[c] *= at->root[r];
                w[r][c] = entry[c] + s[c];
                s[c] = 0.0;
            }
            for (unsigned i = 0; i <= r; i++) {
                for (unsigned c = 0; c < HSEP_TILE; c++) {
                    s[c] += at->T[i][r] * w[i][c];
                }
            }
            for (unsigned c = 0; c < HSEP_TILE; c++) {
                entry[c] = (entry[c] - s[c]) * at->inverse[r];
                entry[HSEP_TILE_ENTRIES + c] = 0.0;
            }
        }
    }
}

/* Reflect the columns behind a panel. x: first of these in the first row; W: (4, width), work. */
HSEP_INLINE void block_apply(
    const block_reflectors *at, double *x, uint64_t stride, double *tiles, double *W, uint64_t width)
{
    double v[HSEP_TILE], w[HSEP_TILE];
    uint64_t b = 0;
    memset(W, 0, (size_t)(HSEP_TILE * width) * sizeof(double));
    for (; b + 2 <= at->m; b += 2) {
        block_entries(at, b, v);
        block_entries(at, b + 1, w);
        block_add_two(W, width, x + b * stride, x + (b + 1) * stride, v, w);
    }
    for (unsigned r = 0; b < at->m && r < HSEP_TILE; r++) { /* an odd row */
        hsep_axpy(W + r * width, at->v[r * at->m + b], x + b * stride, width);
    }
    block_turn(at, tiles, W, width);
    for (b = 0; b + 2 <= at->m; b += 2) {
        block_entries(at, b, v);
        block_entries(at, b + 1, w);
        block_subtract_two(x + b * stride, x + (b + 1) * stride, W, width, v, w);
    }
    for (unsigned r = 0; b < at->m && r < HSEP_TILE; r++) {
        hsep_axpy(x + b * stride, -at->v[r * at->m + b], W + r * width, width);
    }
}

HSEP_INLINE void block_fold(hsep_regression *self, double work[], uint64_t count, int is_triangle)
{
    const uint64_t n = self->n, stride = block_width(n);
    double *inverse_d = hsep_at(self, self->inverse_d), *tile = hsep_at(self, self->tiles);
    double *W = work + stride * count, *V = W + HSEP_TILE * stride;
    for (uint64_t first = 0; first <= n; first += HSEP_TILE) {
        const uint64_t width = stride - first - HSEP_TILE; /* behind the panel */
        block_reflectors at = {.v = V, .m = is_triangle && first + HSEP_TILE < count ? first + HSEP_TILE : count};
        double tau[HSEP_TILE] = {0.0};
        for (uint64_t b = 0; b < at.m; b++) {
            for (unsigned c = 0; c < HSEP_TILE; c++) {
                V[c * at.m + b] = work[b * stride + first + c];
            }
        }
        for (unsigned r = 0; r < HSEP_TILE && first + r < n; r++) {
            tau[r] = block_reflect(&at, tile, inverse_d + first + r, r);
        }
        if (width == 0) { /* the panel of the target */
            const double *target = V + (n - first) * at.m;
            self->residual_sum += hsep_dot(target, target, at.m);
        } else {
            block_triangle(&at, tau);
            block_apply(&at, work + first + HSEP_TILE, stride, tile + HSEP_TILE_STRIDE, W, width);
        }
        tile += HSEP_TILE_STRIDE * (1 + width / HSEP_TILE);
    }
    self->n_samples += count;
}

HSEP_WIDE static void block_fold_wide(hsep_regression *self, double work[], uint64_t count, int is_triangle)
{
    block_fold(self, work, count, is_triangle);
}

HSEP_API void hsep_block_fold(hsep_regression *self, double work[], uint64_t count, int is_triangle, int wide)
{
    if (wide) {
        block_fold_wide(self, work, count, is_triangle);
    } else {
        block_fold(self, work, count, is_triangle);
    }
}

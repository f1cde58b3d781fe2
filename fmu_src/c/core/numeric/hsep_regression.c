#include "hsep_regression.h"

#include "hsep_math.h"

#include <stddef.h>
#include <string.h>

/* The unit triangle U = D^(-1/2) R with z beside it is kept in tiles of 4 x 4, by rows, row of tiles after row of
 * tiles, from the diagonal tile to the right: a sweep over 4 rows runs through memory once, and a compiler makes
 * vectors of a tile's rows without knowing how long they are. Columns after the target are 0 for ever.
 * Each tile is followed by its carry: the rounding errors of its entries, to be added back with the next row. Without
 * it an entry drifts at random, by half a unit in its last place a row. */
#define REGRESSION_TILE 4
#define REGRESSION_TILE_ENTRIES 16 /* of a tile */
#define REGRESSION_TILE_STRIDE 32  /* numbers from tile to tile: the entries, then their carries */

/* Entry (i, j), i <= j, of [U z]. */
static hsep_real *regression_entry(hsep_regression *self, hsep_int i, hsep_int j)
{
    const hsep_int row = i / REGRESSION_TILE, column = j / REGRESSION_TILE;
    const hsep_int tile = row * self->n_tiles - row * (row + 1) / 2 + column; /* fewer by one in each row of them */
    return hsep_at(self, self->tiles) + REGRESSION_TILE_STRIDE * tile + 4 * (i % REGRESSION_TILE) + j % REGRESSION_TILE;
}

static const hsep_real regression_lambda_min = HSEP_TINY(1e-290);

/* Set what follows from the number of features; return the bytes of the block. */
static hsep_real regression_lay_out(hsep_regression *self, hsep_int n)
{
    hsep_real end = HSEP_WORDS(hsep_regression);
    self->n = n;
    self->n_tiles = n / REGRESSION_TILE + 1;
    const hsep_real n_tiles = (hsep_real)self->n_tiles;
    self->inverse_d = hsep_take(&end, REGRESSION_TILE * n_tiles);
    self->row = hsep_take(&end, REGRESSION_TILE * n_tiles);
    self->tiles = hsep_take(&end, REGRESSION_TILE_STRIDE * 0.5 * n_tiles * (n_tiles + 1.0));
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_regression_size(hsep_int n) { return regression_lay_out(&(hsep_regression){0}, n); }

HSEP_API void hsep_regression_init(hsep_regression *self, hsep_int n, hsep_real lambda)
{
    memset(self, 0, (size_t)hsep_regression_size(n));
    (void)regression_lay_out(self, n);
    for (hsep_int i = 0; i < n; i++) {
        hsep_at(self, self->inverse_d)[i] = 1.0 / (lambda < regression_lambda_min ? regression_lambda_min : lambda);
        *regression_entry(self, i, i) = 1.0;
    }
}

HSEP_API hsep_real *hsep_regression_row(hsep_regression *self) { return hsep_at(self, self->row); }

/* Rotate 4 entries x of the row with 4 entries u of a row of U:  x := x - pivot u,  u := u + gain x, whose rounding
 * error is kept in carry and added back next time (Kahan 1965). Written out for compilers to make vectors of it. */
static inline void regression_four(hsep_real *restrict u, hsep_real *restrict x, hsep_real pivot, hsep_real gain)
{
    hsep_real *restrict carry = u + REGRESSION_TILE_ENTRIES;
    const hsep_real u0 = u[0], u1 = u[1], u2 = u[2], u3 = u[3];
    const hsep_real x0 = x[0] - pivot * u0, x1 = x[1] - pivot * u1, x2 = x[2] - pivot * u2, x3 = x[3] - pivot * u3;
    const hsep_real c0 = gain * x0 + carry[0], c1 = gain * x1 + carry[1];
    const hsep_real c2 = gain * x2 + carry[2], c3 = gain * x3 + carry[3];
    const hsep_real s0 = u0 + c0, s1 = u1 + c1, s2 = u2 + c2, s3 = u3 + c3;
    const hsep_real e0 = c0 - (s0 - u0), e1 = c1 - (s1 - u1), e2 = c2 - (s2 - u2), e3 = c3 - (s3 - u3);
    u[0] = s0, u[1] = s1, u[2] = s2, u[3] = s3;
    carry[0] = e0, carry[1] = e1, carry[2] = e2, carry[3] = e3;
    x[0] = x0, x[1] = x1, x[2] = x2, x[3] = x3;
}

/* Rotate the row x, (4 n,), with 4 rows of U in n tiles. */
static inline void regression_sweep(
    hsep_real *restrict tile, hsep_real *restrict x, hsep_int n, const hsep_real pivot[4], const hsep_real gain[4])
{
    const hsep_real p0 = pivot[0], p1 = pivot[1], p2 = pivot[2], p3 = pivot[3];
    const hsep_real g0 = gain[0], g1 = gain[1], g2 = gain[2], g3 = gain[3];
    for (hsep_int t = 0; t < n; t++, tile += REGRESSION_TILE_STRIDE, x += 4) {
        hsep_real y[4] = {x[0], x[1], x[2], x[3]};
        regression_four(tile, y, p0, g0);
        regression_four(tile + 4, y, p1, g1);
        regression_four(tile + 8, y, p2, g2);
        regression_four(tile + 12, y, p3, g3);
        x[0] = y[0], x[1] = y[1], x[2] = y[2], x[3] = y[3];
    }
}

/* Rotate one entry; u becomes  keep u + gain x  of the x before if large: that loses nothing when keep is small. */
static void regression_rotate(
    hsep_real *tile, int place, hsep_real *x, hsep_real pivot, hsep_real gain, hsep_real keep, int large)
{
    hsep_real *u = &tile[place], *carry = &tile[REGRESSION_TILE_ENTRIES + place];
    const hsep_real before = *x;
    *x = before - pivot * *u;
    if (large) {
        *u = keep * *u + gain * before;
        *carry = 0.0;
    } else {
        const hsep_real wanted = gain * *x + *carry, sum = *u + wanted;
        *carry = wanted - (sum - *u);
        *u = sum;
    }
}

/* As regression_sweep, where row r is large if large[r]. */
static void regression_sweep_large(
    hsep_real *restrict tile, hsep_real *restrict x, hsep_int n, const hsep_real pivot[4], const hsep_real gain[4],
    const hsep_real keep[4], const int large[4])
{
    for (hsep_int t = 0; t < n; t++, tile += REGRESSION_TILE_STRIDE, x += 4) {
        for (int r = 0; r < 4; r++) {
            if (!large[r]) {
                regression_four(tile + 4 * r, x, pivot[r], gain[r]);
                continue;
            }
            for (int c = 0; c < 4; c++) {
                regression_rotate(tile, 4 * r + c, &x[c], pivot[r], gain[r], keep[r], 1);
            }
        }
    }
}

HSEP_API void hsep_regression_fold(hsep_regression *self)
{
    hsep_real *inverse_d = hsep_at(self, self->inverse_d), *x = hsep_regression_row(self);
    hsep_real *tile = hsep_at(self, self->tiles);
    /* The row still weighs 1/v. With x_j its entry at the pivot, u a row of U and d that row's weight:
     *   v' = v + x_j^2 / d          d' = d v'/v         keep = v / v' = cos^2        gain = x_j / (d v')
     *   x := x - x_j u              u := keep u + gain x = u + gain (x - x_j u)
     * v, and with it every division, is not needed for the x of the next pivot: they run beside the sweeps.
     * The last form is the cheapest and its rounding error is a Givens rotation's divided by the cosine:
     * it is taken where cos^2 >= 1/2, and keep u + gain x, without that factor, elsewhere. */
    hsep_real v = 1.0;
    hsep_int rows = self->n;
    for (hsep_int left = self->n_tiles; left > 0; left--, x += 4, inverse_d += 4) {
        const unsigned height = rows < REGRESSION_TILE ? (unsigned)rows : REGRESSION_TILE;
        rows -= height;
        hsep_real pivot[4], gain[4], keep[4];
        int large[4], any_large = 0;
        for (unsigned r = 0; r < height; r++) {
            const hsep_real scaled = x[r] * inverse_d[r];
            const hsep_real next = v + x[r] * scaled;
            pivot[r] = x[r];
            gain[r] = scaled / next;
            keep[r] = v / next;
            large[r] = next > 2.0 * v;
            any_large |= large[r];
            inverse_d[r] *= keep[r];
            v = next;
            for (unsigned c = r + 1; c < 4; c++) {
                regression_rotate(tile, (int)(4 * r + c), &x[c], pivot[r], gain[r], keep[r], large[r]);
            }
        }
        if (left > 1 && !any_large) { /* only the last row of tiles has a height below 4 */
            regression_sweep(tile + REGRESSION_TILE_STRIDE, x + 4, left - 1, pivot, gain);
        } else if (left > 1) {
            regression_sweep_large(tile + REGRESSION_TILE_STRIDE, x + 4, left - 1, pivot, gain, keep, large);
        }
        tile += REGRESSION_TILE_STRIDE * left;
    }
    self->n_rows += 1.0;
}

HSEP_API void hsep_regression_solve(const hsep_regression *self, hsep_real w[])
{
    const hsep_int n = self->n, n_tiles = self->n_tiles;
    const hsep_real *tile = hsep_at_const(self, self->tiles) + REGRESSION_TILE_STRIDE / 2 * n_tiles * (n_tiles + 1);
    /* U w = z from the last row to the first; z is column n, and what follows it is 0. */
    for (hsep_int band = n_tiles; band-- > 0;) {
        const hsep_int first = REGRESSION_TILE * band,
                       height = n - first < REGRESSION_TILE ? n - first : REGRESSION_TILE;
        tile -= REGRESSION_TILE_STRIDE * (n_tiles - band);
        hsep_real sum[4] = {0.0, 0.0, 0.0, 0.0};
        const hsep_real *t = tile + REGRESSION_TILE_STRIDE;
        for (hsep_int j = first + 4; j + 4 <= n;
             j += 4, t += REGRESSION_TILE_STRIDE) { /* tiles that are all features */
            for (int r = 0; r < 4; r++) {
                sum[r] += t[4 * r] * w[j] + t[4 * r + 1] * w[j + 1] + t[4 * r + 2] * w[j + 2] + t[4 * r + 3] * w[j + 3];
            }
        }
        for (hsep_int r = height; r-- > 0;) {
            /* w_r = z_r - sum_j>r u_rj w_j: the target's tile has the last features and z, and may be this one. */
            const hsep_real *last = tile + REGRESSION_TILE_STRIDE * (n_tiles - 1 - band) + 4 * r;
            hsep_real w_r = last[n % REGRESSION_TILE] - sum[r];
            for (hsep_int c = 0; height == REGRESSION_TILE && c < n % REGRESSION_TILE; c++) {
                w_r -= last[c] * w[n - n % REGRESSION_TILE + c];
            }
            for (hsep_int c = r + 1; c < height; c++) {
                w_r -= tile[4 * r + c] * w[first + c];
            }
            w[first + r] = w_r;
        }
    }
}

HSEP_API void hsep_regression_load(hsep_regression *self, hsep_int i)
{
    const hsep_int n = self->n;
    const hsep_real *row = hsep_regression_row(self);
    if (i == n) { /* rho, which no weight depends on */
        return;
    }
    hsep_at(self, self->inverse_d)[i] = 1.0 / hsep_fmax(row[0] * row[0], regression_lambda_min);
    for (hsep_int j = i + 1; j <= n; j++) {
        hsep_real *entry = regression_entry(self, i, j);
        entry[0] = row[j - i] / row[0]; /* U = D^(-1/2) R, and z alike */
        entry[REGRESSION_TILE_ENTRIES] = 0.0;
    }
}

#include "hsep_splines.h"

#include "hsep_vector.h"

#include <string.h>

HSEP_API const double *hsep_splines_shape(const hsep_splines *self) { return hsep_at_const(self, self->shape); }

/* The differences of an order of one spline, in shares, (4 spacing + order,); the first one is 0. */
static const double *splines_differences(const hsep_splines *self, unsigned order)
{
    return hsep_at_const(self, self->differences[order]);
}

static uint64_t splines_length(const hsep_splines *self, unsigned order) { return 4 * self->spacing + order; }

HSEP_API uint64_t hsep_splines_count(uint64_t preview, uint64_t spacing)
{
    return (preview - 4 * spacing - HSEP_DECIDED) / spacing + 1;
}

/* Set what follows from the parameters; return the bytes of the block. */
static double splines_lay_out(hsep_splines *self, uint64_t preview, uint64_t spacing)
{
    double end = HSEP_WORDS(hsep_splines);
    self->preview = preview;
    self->spacing = spacing;
    self->n = hsep_splines_count(preview, spacing);
    self->shape = hsep_take(&end, 4.0 * (double)spacing);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        self->differences[order] = hsep_take(&end, 4.0 * (double)spacing + 3.0);
    }
    return end * sizeof(double);
}

HSEP_API double hsep_splines_size(uint64_t preview, uint64_t spacing)
{
    return splines_lay_out(&(hsep_splines){0}, preview, spacing);
}

HSEP_API int hsep_splines_valid(const void *block, uint64_t preview, uint64_t spacing)
{
    hsep_splines got;
    memcpy(&got, block, sizeof got);
    (void)splines_lay_out(&got, preview, spacing); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0;
}

/* The uniform cubic B-spline on the knots 0, 1, 2, 3, 4. */
static double splines_b(double u)
{
    if (u >= 2.0) {
        u = 4.0 - u; /* it is symmetric */
    }
    return u < 1.0 ? u * u * u / 6.0 : (((-3.0 * u + 12.0) * u - 12.0) * u + 4.0) / 6.0;
}

HSEP_API void hsep_splines_init(hsep_splines *self, uint64_t preview, uint64_t spacing, const double limit[HSEP_ORDERS])
{
    (void)splines_lay_out(self, preview, spacing);
    const uint64_t width = 4 * spacing;
    double *b = hsep_at(self, self->shape);
    for (uint64_t k = 0; k < width; k++) {
        b[k] = splines_b((double)k / (double)spacing);
    }
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        hsep_splines_limit(self, order, limit[order]);
    }
}

HSEP_API void hsep_splines_limit(hsep_splines *self, unsigned order, double limit)
{
    const uint64_t width = 4 * self->spacing;
    const double *b = hsep_splines_shape(self);
    double *e = hsep_at(self, self->differences[order]);
    self->share[order] = 1.0 / limit;
    for (uint64_t k = 0; k < width + 3; k++) {
        const double at[HSEP_ORDERS] = {
            k < width ? b[k] : 0.0, k >= 1 && k - 1 < width ? b[k - 1] : 0.0, k >= 2 && k - 2 < width ? b[k - 2] : 0.0,
            k >= 3 ? b[k - 3] : 0.0};
        const double difference[HSEP_ORDERS] = {
            at[0], at[0] - at[1], (at[0] - at[1]) - (at[1] - at[2]),
            ((at[0] - at[1]) - (at[1] - at[2])) - ((at[1] - at[2]) - (at[2] - at[3]))};
        e[k] = difference[order] * self->share[order];
    }
}

HSEP_API double hsep_splines_sum(const hsep_splines *self, const double c[], uint64_t count, uint64_t k)
{
    const double *b = hsep_splines_shape(self);
    const uint64_t place = k / self->spacing, within = k % self->spacing;
    double sum = 0.0;
    for (uint64_t i = 0; i <= HSEP_DECIDED && place + i < count; i++) {
        sum += c[place + i] * b[within + (HSEP_DECIDED - i) * self->spacing];
    }
    return sum;
}

/* delta, (preview,), of the splines first ... n - 1 with coefficients c, (n - first,). */
static void splines_change(const hsep_splines *self, const double c[], uint64_t first, double delta[])
{
    const double *b = hsep_splines_shape(self);
    const uint64_t spacing = self->spacing, count = self->n - first;
    uint64_t k = first * spacing;
    memset(delta, 0, (size_t)k * sizeof(double));
    for (uint64_t place = 0; k < self->preview; place++) { /* between two knots */
        const uint64_t end = k + spacing < self->preview ? k + spacing : self->preview;
        if (place >= HSEP_DECIDED && place < count) {
            const double c0 = c[place], c1 = c[place - 1], c2 = c[place - 2], c3 = c[place - 3];
            for (const double *at = b; k < end; k++, at++) {
                delta[k] = ((c0 * at[0] + c1 * at[spacing]) + c2 * at[2 * spacing]) + c3 * at[3 * spacing];
            }
        }
        for (uint64_t within = 0; k < end; k++, within++) { /* not all four are there */
            delta[k] = 0.0;
            for (uint64_t i = 0; i <= HSEP_DECIDED && i <= place; i++) {
                if (place - i < count) {
                    delta[k] += c[place - i] * b[within + i * spacing];
                }
            }
        }
    }
}

HSEP_API void hsep_splines_rows(const hsep_splines *self, const double c[], uint64_t first, double rows[])
{
    const uint64_t preview = self->preview;
    splines_change(self, c, first, rows);
    for (unsigned order = 1; order < HSEP_ORDERS; order++) {
        const double *of = rows + (order - 1) * preview;
        double *to = rows + order * preview;
        uint64_t k = 1;
        to[0] = of[0];
        for (; k + HSEP_LANES <= preview; k += HSEP_LANES) {
            *hsep_lanes_at(to + k) = *hsep_lanes_const(of + k) - *hsep_lanes_const(of + k - 1);
        }
        for (; k < preview; k++) {
            to[k] = of[k] - of[k - 1];
        }
    }
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        double *row = rows + order * preview;
        const double share = self->share[order];
        uint64_t k = 0;
        for (; k + HSEP_LANES <= preview; k += HSEP_LANES) {
            *hsep_lanes_at(row + k) *= share;
        }
        for (; k < preview; k++) {
            row[k] *= share;
        }
    }
}

HSEP_API void hsep_splines_touched(
    const hsep_splines *self, uint64_t first, unsigned order, uint64_t *begin, uint64_t *end)
{
    *begin = first * self->spacing + 1; /* a spline begins with 0 */
    *end = (self->n - 1) * self->spacing + splines_length(self, order);
}

HSEP_API void hsep_splines_transpose(const hsep_splines *self, double rows[], uint64_t first, double g[])
{
    const double *b = hsep_splines_shape(self);
    const uint64_t preview = self->preview, spacing = self->spacing;
    const double s0 = self->share[0], s1 = self->share[1], s2 = self->share[2], s3 = self->share[3];
    const double *r1 = rows + preview, *r2 = rows + 2 * preview, *r3 = rows + 3 * preview;
    /* A' = B' (s_0 + D' (s_1 + D' (s_2 + D' s_3))) with the differences D: what later samples say comes first. */
    const uint64_t begin = first * spacing + 1, end = self->n * spacing + 3 * spacing; /* of the change itself */
    const double a3 = s3 * r3[end + 2], b3 = s3 * r3[end + 1], a2 = s2 * r2[end + 1] + (b3 - a3);
    double u3 = s3 * r3[end], u2 = s2 * r2[end] + (u3 - b3), u1 = s1 * r1[end] + (u2 - a2);
    for (uint64_t k = end; k-- > begin;) {
        const double v3 = s3 * r3[k], v2 = s2 * r2[k] + (v3 - u3), v1 = s1 * r1[k] + (v2 - u2);
        rows[k] = s0 * rows[k] + (v1 - u1);
        u1 = v1, u2 = v2, u3 = v3;
    }
    for (uint64_t j = first; j < self->n; j++) {
        g[j - first] += hsep_dot(b + 1, rows + j * spacing + 1, 4 * spacing - 1);
    }
}

/* Weights of the rows of an order, (preview,), so that those of samples spacing apart are neighbours. */
static void splines_sort(const hsep_splines *self, const double weights[], double sorted[])
{
    for (uint64_t phase = 0; phase < self->spacing; phase++) {
        for (uint64_t k = phase; k < self->preview; k += self->spacing) {
            *sorted++ = weights[k];
        }
    }
}

#define SPLINES_TOGETHER 8 /* splines whose products with another one are summed side by side */

/* sums, (count,), count <= SPLINES_TOGETHER: of splines i ... i + count - 1 with those d behind them. sorted: (4,
 * preview). */
static void splines_products(
    const hsep_splines *self, const double sorted[], uint64_t i, uint64_t count, uint64_t d, double sums[])
{
    const uint64_t spacing = self->spacing;
    hsep_lanes acc[SPLINES_TOGETHER / HSEP_LANES];
    memset(sums, 0, SPLINES_TOGETHER * sizeof *sums);
    memcpy(acc, sums, sizeof acc);
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const double *e = splines_differences(self, order);
        const uint64_t length = splines_length(self, order);
        uint64_t begin = order * self->preview; /* of a phase */
        for (uint64_t phase = 0; phase < spacing; phase++) {
            const double *weight = sorted + begin + i;
            for (uint64_t k = phase, m = 0; k < length; k += spacing, m++) {
                if (k < d * spacing + 1) {
                    continue;
                }
                const double product = e[k] * e[k - d * spacing];
                if (count == SPLINES_TOGETHER) {
                    for (int l = 0; l < SPLINES_TOGETHER / HSEP_LANES; l++) {
                        acc[l] += product * hsep_lanes_const(weight + m)[l];
                    }
                } else {
                    for (uint64_t l = 0; l < count; l++) {
                        sums[l] += product * weight[m + l];
                    }
                }
            }
            begin += (self->preview - phase - 1) / spacing + 1;
        }
    }
    if (count == SPLINES_TOGETHER) {
        memcpy(sums, acc, sizeof acc);
    }
}

HSEP_API void hsep_splines_gram(
    const hsep_splines *self, const double weights[], uint64_t first, double triangle[], double work[])
{
    const uint64_t n = self->n - first;
    double sums[SPLINES_TOGETHER];
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        splines_sort(self, weights + order * self->preview, work + order * self->preview);
    }
    for (uint64_t d = 0; d < n && d * self->spacing + 1 < splines_length(self, HSEP_ORDERS - 1); d++) {
        double *entry = triangle + d;
        for (uint64_t i = 0; i + d < n; i += SPLINES_TOGETHER) {
            const uint64_t left = n - d - i, count = left < SPLINES_TOGETHER ? left : SPLINES_TOGETHER;
            splines_products(self, work, first + i, count, d, sums);
            for (uint64_t l = 0; l < count; l++) {
                *entry += sums[l];
                entry += n - (i + l);
            }
        }
    }
}

HSEP_API double hsep_splines_energy(const hsep_splines *self)
{
    double sum = 0.0;
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const double *e = splines_differences(self, order);
        sum += hsep_dot(e, e, splines_length(self, order));
    }
    return sum;
}

/* Entry (i, j), i <= j, of a triangle of n rows. */
static double *splines_entry(double triangle[], uint64_t n, uint64_t i, uint64_t j)
{
    return triangle + i * n - i * (i + 1) / 2 + j; /* rows 0 ... i - 1 have n, n - 1, ... entries */
}

HSEP_API void hsep_splines_filtered_gram(const hsep_splines *self, const double filtered[], double triangle[])
{
    const uint64_t n = self->n, spacing = self->spacing;
    for (uint64_t d = 0; d < n; d++) {
        /* Columns j - d and j: sum over u of s(u + d spacing) s(u), up to where column j is cut off */
        double sum = 0.0;
        uint64_t u = 0;
        for (uint64_t j = n; j-- > d;) {
            for (; u + j * spacing < self->preview; u++) {
                sum += filtered[u + d * spacing] * filtered[u];
            }
            *splines_entry(triangle, n, j - d, j) = sum;
        }
    }
}

/* Sum over k of the differences of an order, m, of a spline and of the one d splines later. */
static double splines_overlap(const hsep_splines *self, unsigned order, uint64_t d)
{
    const double *e = splines_differences(self, order);
    const double unit = 1.0 / self->share[order];
    double sum = 0.0;
    for (uint64_t k = d * self->spacing + 1; k < splines_length(self, order); k++) {
        sum += (e[k] * unit) * (e[k - d * self->spacing] * unit);
    }
    return sum;
}

/* Splines behind one that overlap it in the differences of an order, and it itself. */
static uint64_t splines_neighbours(const hsep_splines *self, unsigned order)
{
    const uint64_t count = (splines_length(self, order) - 2) / self->spacing + 1;
    return count < self->n ? count : self->n;
}

HSEP_API void hsep_splines_difference_gram(const hsep_splines *self, unsigned order, double weight, double triangle[])
{
    for (uint64_t d = 0; d < splines_neighbours(self, order); d++) {
        const double sum = splines_overlap(self, order, d);
        for (uint64_t i = 0; i + d < self->n; i++) {
            *splines_entry(triangle, self->n, i, i + d) += weight * sum;
        }
    }
}

HSEP_API void hsep_splines_difference_product(
    const hsep_splines *self, unsigned order, double weight, const double c[], double y[])
{
    for (uint64_t d = 0; d < splines_neighbours(self, order); d++) {
        const double sum = weight * splines_overlap(self, order, d);
        for (uint64_t i = 0; i + d < self->n; i++) {
            y[i] += sum * c[i + d];
            y[i + d] += d > 0 ? sum * c[i] : 0.0;
        }
    }
}

HSEP_API void hsep_splines_project_jerk(const hsep_splines *self, double weight, const double third[], double v[])
{
    const double *e = splines_differences(self, 3);
    const double unit = weight / self->share[3];
    for (uint64_t j = 0; j < self->n; j++) {
        const double *past = third + j * self->spacing;
        double jerk = 0.0;
        for (uint64_t k = 1; k < splines_length(self, 3); k++) {
            jerk += e[k] * past[k];
        }
        v[j] -= unit * jerk;
    }
}

HSEP_API void hsep_splines_project(
    const hsep_splines *self, const double filtered[], const double target[], double weight, const double third[],
    double v[])
{
    for (uint64_t j = 0; j < self->n; j++) {
        v[j] = hsep_dot(filtered, target + j * self->spacing, self->preview - j * self->spacing);
    }
    hsep_splines_project_jerk(self, weight, third, v);
}

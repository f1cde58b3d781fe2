/* Accumulate steps in the C core's clock and compare with the exact sum of the same doubles in 128-bit integers.
 *
 * Arguments: number of steps, start s, T_s s, whether the importer's times are in single precision and a step is their
 * difference, then the step sizes s that take turns. Prints the largest deviation of the clock's time since the last
 * instant from the exact one, in T_s; how often the number of instants reached was another one than the rule's; that
 * number; the drift of the importer's time against the sum of samples, in T_s.
 */
#include "hsep_clock.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define SIZES_MAX 16

typedef __int128 wide;

/* Times are counted in 2^-84 s: every double of at least 2^-31 s is a whole number of them. */
static const int unit = -84;

static wide exact(double time)
{
    int exponent = 0;
    const double mantissa = frexp(time, &exponent); /* time = mantissa 2^exponent */
    const wide digits = (wide)ldexp(mantissa, 53);
    const int shift = exponent - 53 - unit;
    return shift >= 0 ? digits << shift : digits >> -shift;
}

int main(int n_arguments, char *arguments[])
{
    if (n_arguments < 6 || n_arguments > 5 + SIZES_MAX) {
        fprintf(stderr, "usage: clock STEPS START T_s SINGLE SIZE ...\n");
        return 2;
    }
    const int64_t n_steps = strtoll(arguments[1], NULL, 10);
    const double start = strtod(arguments[2], NULL), T_s = strtod(arguments[3], NULL);
    const int single = atoi(arguments[4]), n_sizes = n_arguments - 5;
    double size[SIZES_MAX];
    for (int i = 0; i < n_sizes; i++) {
        size[i] = strtod(arguments[5 + i], NULL);
    }
    hsep_clock clock;
    hsep_clock_step step;
    if (!hsep_clock_init(&clock, start, T_s)) {
        fprintf(stderr, "the start time is too large\n");
        return 2;
    }
    /* Only what has passed since the last instant is kept exactly, so that 128 bits suffice. */
    const wide T = exact(T_s);
    wide since = 0;
    double worst = 0.0, t = single ? (double)(float)start : start;
    int64_t k = 0, wrong = 0;
    for (int64_t i = 0; i < n_steps; i++) {
        const double next = start + (double)(i + 1) * size[0];
        const double h = single ? (double)(float)next - t : size[i % n_sizes];
        if (!hsep_clock_count(&clock, t, h, &step)) {
            fprintf(stderr, "refused: step %" PRId64 " from %.17g s, expected %.17g s\n", i, t, clock.end);
            return 1;
        }
        clock = step.after;
        t += h; /* as an importer does that rounds and drifts */
        since += exact(h);
        const double resolution = 8.0 * (nextafter(fabs(t), HUGE_VAL) - fabs(t));
        const wide delta = exact(fmin(fmax(0.05 * T_s, resolution), 0.5 * h)), n = (since + delta) / T;
        k += (int64_t)n;
        since -= n * T;
        since = n > 0 && since <= delta ? 0 : since;
        wrong += k != clock.k;
        const wide off = exact(clock.since) - since;
        worst = fmax(worst, fabs(ldexp((double)off, unit)) / T_s);
    }
    printf("%.3g %" PRId64 " %" PRId64 " %.6g\n", worst, wrong, clock.k, (t - (start + (double)k * T_s)) / T_s);
    return 0;
}

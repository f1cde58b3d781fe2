#include "hsep_median.h"

/* Let the value at a place sink in a heap of n, the largest on top. */
static void median_sink(double values[], uint64_t n, uint64_t place)
{
    const double value = values[place];
    for (uint64_t below = 2 * place + 1; below < n; below = 2 * place + 1) {
        if (below + 1 < n && values[below + 1] > values[below]) {
            below++;
        }
        if (!(values[below] > value)) {
            break;
        }
        values[place] = values[below];
        place = below;
    }
    values[place] = value;
}

HSEP_API double hsep_median(double values[], uint64_t n)
{
    for (uint64_t place = n / 2; place-- > 0;) {
        median_sink(values, n, place);
    }
    const uint64_t kept = n / 2 + 1; /* the largest of them is the upper one in the middle */
    for (uint64_t left = n; left > kept; left--) {
        values[0] = values[left - 1];
        median_sink(values, left - 1, 0);
    }
    if (n % 2 == 1) {
        return values[0];
    }
    return 0.5 * (values[0] + (kept > 2 && values[2] > values[1] ? values[2] : values[1]));
}

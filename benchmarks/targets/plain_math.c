/* The functions of libm that the core calls and that are not exact, in plain arithmetic.
 *
 * Libraries of mathematics differ in the last bit; with these on both machines, what differs is the core's own.
 * Errors are a few units in the last place; arguments as the core has them.
 */
#include <float.h>
#include <math.h>

static const double log_2_high = 6.93147180369123816490e-01, log_2_low = 1.90821492927058770002e-10;

double exp(double x)
{
    if (!(x < 709.7)) {
        return x + HUGE_VAL; /* NaN stays */
    }
    if (x < -745.0) {
        return 0.0;
    }
    const int n = (int)(x / (log_2_high + log_2_low) + (x < 0.0 ? -0.5 : 0.5));
    const double r = (x - n * log_2_high) - n * log_2_low;
    double sum = 1.0;
    for (int i = 14; i > 0; i--) {
        sum = 1.0 + r * sum / i;
    }
    return ldexp(sum, n);
}

/* log x for x > 0. */
static double logarithm(double x)
{
    int n;
    double m = frexp(x, &n);
    if (m < 0.70710678118654752) {
        m *= 2.0;
        n--;
    }
    const double s = (m - 1.0) / (m + 1.0);
    double sum = 0.0;
    for (int i = 23; i > 0; i -= 2) {
        sum = sum * s * s + 2.0 / i;
    }
    return n * log_2_high + (s * sum + n * log_2_low);
}

double pow(double x, double y)
{
    if (y == 0.0 || x == 1.0) {
        return 1.0;
    }
    return x > 0.0 ? exp(y * logarithm(x)) : x == 0.0 && y > 0.0 ? 0.0 : (x - x) / (x - x);
}

double tanh(double x)
{
    if (fabs(x) > 0.5) {
        const double size = 1.0 - 2.0 / (exp(2.0 * fabs(x)) + 1.0);
        return x < 0.0 ? -size : size;
    }
    double fraction = 21.0; /* x / (1 + x^2 / (3 + x^2 / (5 + ...))) */
    for (int i = 19; i > 0; i -= 2) {
        fraction = i + x * x / fraction;
    }
    return x / fraction;
}

/* sin(x + quarters pi / 2). */
static double sine(double x, int quarters)
{
    const double high = 1.57079632673412561417, low = 6.07710050650619224932e-11; /* pi / 2 */
    const int n = (int)(x / high + (x < 0.0 ? -0.5 : 0.5));
    const double r = (x - n * high) - n * low, square = r * r;
    const unsigned quadrant = (unsigned)(n + quarters);
    double sum = 1.0;
    for (int i = 20 + (int)(quadrant % 2 == 0); i > 1; i -= 2) {
        sum = 1.0 - square / (i * (i - 1)) * sum;
    }
    const double value = quadrant % 2 == 0 ? r * sum : sum;
    return quadrant & 2 ? -value : value;
}

double sin(double x) { return sine(x, 0); }

double cos(double x) { return sine(x, 1); }

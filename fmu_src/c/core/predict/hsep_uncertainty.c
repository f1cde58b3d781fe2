#include "hsep_uncertainty.h"

#include "hsep_predict_constants.h"
#include "hsep_range.h"
#include "hsep_vector.h"

#include <math.h>
#include <string.h>

static const double uncertainty_shares[HSEP_N_COMPONENTS] = {0.0, HSEP_UNCERTAINTY_SHARES};
static const double uncertainty_levels[][2] = {HSEP_UNCERTAINTY_LEVELS};

/* Set what follows from the parameters; return the bytes of the block. */
static double uncertainty_lay_out(hsep_uncertainty *self, uint64_t Np, uint64_t n)
{
    double end = HSEP_WORDS(hsep_uncertainty);
    self->Np = Np;
    self->n = n;
    self->e_h = hsep_take(&end, (double)n);
    self->components = hsep_take(&end, (double)n * HSEP_N_COMPONENTS);
    self->std = hsep_take(&end, (double)n);
    return end * sizeof(double);
}

HSEP_API double hsep_uncertainty_size(uint64_t Np, uint64_t n)
{
    return uncertainty_lay_out(&(hsep_uncertainty){0}, Np, n);
}

HSEP_API double hsep_uncertainty_first_variance(double lambda, double noise_std)
{
    return noise_std > 0.0 ? fmax(lambda, noise_std * noise_std)
                           : fmin(HSEP_UNCERTAINTY_UNKNOWN_NOISE * lambda, HSEP_PREDICTION_MAX);
}

HSEP_API void hsep_uncertainty_init(hsep_uncertainty *self, uint64_t Np, uint64_t n, double variance)
{
    memset(self, 0, (size_t)hsep_uncertainty_size(Np, n));
    (void)uncertainty_lay_out(self, Np, n);
    memcpy(self->theta, uncertainty_shares, sizeof self->theta);
    self->theta[0] = variance;
    self->factor = self->ratio = 1.0;
}

HSEP_API int hsep_uncertainty_valid(const void *block, uint64_t Np, uint64_t n)
{
    hsep_uncertainty got;
    memcpy(&got, block, sizeof got);
    (void)uncertainty_lay_out(&got, Np, n); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0 && hsep_uncertainty_sound(&got);
}

HSEP_API double *hsep_uncertainty_learned(hsep_uncertainty *self) { return self->theta; }

HSEP_API int hsep_uncertainty_sound(const hsep_uncertainty *self)
{
    double learned[HSEP_N_UNCERTAINTY];
    memcpy(learned, (const char *)self + sizeof self->Np, sizeof learned);
    int sound = self->factor >= 1.0 / HSEP_UNCERTAINTY_FACTOR_MAX && self->factor <= HSEP_UNCERTAINTY_FACTOR_MAX &&
                self->ratio >= 1.0 / HSEP_UNCERTAINTY_RATIO_MAX && self->ratio <= HSEP_UNCERTAINTY_RATIO_MAX;
    for (int i = 0; i < HSEP_N_UNCERTAINTY; i++) {
        const double share = i < HSEP_N_COMPONENTS ? uncertainty_shares[i] : 0.0;
        const double least = HSEP_UNCERTAINTY_LEAST_SHARE * share;
        const double most = share > 0.0 ? HSEP_UNCERTAINTY_MOST_SHARE * share : HSEP_PREDICTION_MAX;
        sound = sound && learned[i] >= least && learned[i] <= most;
    }
    return sound;
}

/* Variance of the error with these components. */
static double uncertainty_variance(const hsep_uncertainty *self, const double components[])
{
    return hsep_dot(self->theta, components, HSEP_N_COMPONENTS) +
           (HSEP_UNCERTAINTY_FLOOR * self->recent + HSEP_UNCERTAINTY_LEAST_VARIANCE);
}

/* Place of sample k in a usual window, from -1/2 at its beginning to 1/2 at its end. */
static double uncertainty_from_middle(const hsep_uncertainty *self, uint64_t k)
{
    return fmin(((double)k + 0.5) / (double)self->Np, 1.0) - 0.5;
}

/* Components of the variance at place j, as they are at once. */
static void uncertainty_at(
    const hsep_uncertainty *self, const hsep_uncertainty_signals *signals, uint64_t j, double f[HSEP_N_COMPONENTS])
{
    const double *x_pb = signals->x_pb;
    const uint64_t n = self->n;
    /* The difference of the first sample is that of the second. */
    const uint64_t newer = j + 1 == n && j > 0 ? j - 1 : j, older = newer + 1 < n ? newer + 1 : newer;
    const int stacked = signals->variance != NULL && n - 1 - j >= signals->n_physics;
    f[0] = 1.0;
    const double change = fmin(fabs(x_pb[newer] - x_pb[older]), HSEP_PREDICTION_MAX);
    f[1] = change * change;
    f[2] = stacked ? signals->variance[j] : 0.0;
}

HSEP_API void hsep_uncertainty_predict(
    hsep_uncertainty *self, const hsep_uncertainty_signals *signals, uint64_t first, uint64_t last)
{
    const uint64_t n = self->n;
    const double gain = 1.0 / (1.0 + HSEP_UNCERTAINTY_FELT_FOR * (double)self->Np);
    double *published = hsep_at(self, self->e_h), *std = hsep_at(self, self->std), *felt = self->felt;
    if (first == 0) {
        memset(felt, 0, sizeof self->felt);
    }
    for (uint64_t k = first; k < last; k++) { /* in time, from the last measured sample on */
        published[n - 1 - k] = k < signals->n_physics ? 0.0 : signals->e_h[n - 1 - k];
        double *f = hsep_at(self, self->components) + (n - 1 - k) * HSEP_N_COMPONENTS;
        uncertainty_at(self, signals, n - 1 - k, f);
        for (int i = 1; i < HSEP_N_COMPONENTS; i++) { /* all but the noise */
            felt[i] += gain * (f[i] - felt[i]);
            f[i] = felt[i];
        }
        const double c = self->factor * pow(self->ratio, uncertainty_from_middle(self, k));
        std[n - 1 - k] = fmin(c * sqrt(uncertainty_variance(self, f)), HSEP_PREDICTION_MAX);
    }
}

/* What is summed over the samples that count. */
typedef struct {
    double count, squares, errors; /* samples; squares of residuals and errors, m2 */
    double missed, missed_late;    /* beyond the intervals, more than there may be; weighted by their place */
} uncertainty_sums;

/* Add a sample that is measured. */
static void uncertainty_add(uncertainty_sums *sums, double e, double error, double std, double place)
{
    double missed = 0.0;
    for (size_t i = 0; i < sizeof uncertainty_levels / sizeof *uncertainty_levels; i++) {
        missed += (fabs(error) / std > uncertainty_levels[i][0] ? 1.0 : 0.0) - uncertainty_levels[i][1];
    }
    sums->count += 1.0;
    sums->squares += e * e;
    sums->errors += error * error;
    sums->missed += missed;
    sums->missed_late += missed * place;
}

/* Follow the size of the residuals and the shares of errors beyond the intervals; after the first window, begin with
 * its mean square error. */
static void uncertainty_follow(hsep_uncertainty *self, const uncertainty_sums *sums)
{
    const double count = sums->count, mean_square = fmin(sums->squares / count, HSEP_PREDICTION_MAX);
    if (self->recent > 0.0) {
        const double factor = self->factor * exp(HSEP_UNCERTAINTY_FACTOR_RATE * (sums->missed / count));
        const double ratio = self->ratio * exp(HSEP_UNCERTAINTY_RATIO_RATE * (sums->missed_late / count));
        self->factor = fmin(fmax(factor, 1.0 / HSEP_UNCERTAINTY_FACTOR_MAX), HSEP_UNCERTAINTY_FACTOR_MAX);
        self->ratio = fmin(fmax(ratio, 1.0 / HSEP_UNCERTAINTY_RATIO_MAX), HSEP_UNCERTAINTY_RATIO_MAX);
        self->recent = HSEP_UNCERTAINTY_RECENT * self->recent + (1.0 - HSEP_UNCERTAINTY_RECENT) * mean_square;
    } else {
        self->recent = mean_square;
        self->ratio = HSEP_UNCERTAINTY_RATIO;
        self->theta[0] = fmin(sums->errors / count, HSEP_PREDICTION_MAX);
    }
}

/* A step of expectation maximisation. seen, total: over the samples, the share of each component in the variance, with
 * and without the squared error. */
static void uncertainty_step_by(
    hsep_uncertainty *self, const double seen[HSEP_N_COMPONENTS], const double total[HSEP_N_COMPONENTS])
{
    for (int i = 0; i < HSEP_N_COMPONENTS; i++) {
        const double windows = total[i] / (double)self->Np, share = uncertainty_shares[i];
        self->evidence[i] = HSEP_UNCERTAINTY_MEMORY * self->evidence[i] + windows;
        const double change = fmax(total[i] > 0.0 ? seen[i] / total[i] : 1.0, HSEP_UNCERTAINTY_VANISHING);
        const double step =
            fmin(HSEP_UNCERTAINTY_STEP * windows / (self->evidence[i] + HSEP_UNCERTAINTY_FIRST_EVIDENCE), 1.0);
        const double theta = self->theta[i] * pow(change, step);
        self->theta[i] =
            share == 0.0 ? fmin(fmax(theta, HSEP_UNCERTAINTY_FLOOR * self->recent), HSEP_PREDICTION_MAX)
                         : fmin(fmax(theta, HSEP_UNCERTAINTY_LEAST_SHARE * share), HSEP_UNCERTAINTY_MOST_SHARE * share);
    }
}

HSEP_API void hsep_uncertainty_learn(hsep_uncertainty *self, const double e[], const double accepted[])
{
    const uint64_t newest = self->n - self->Np; /* place of the last one that is measured */
    const double *e_h = hsep_at(self, self->e_h) + newest, *std = hsep_at(self, self->std) + newest;
    const double *f = hsep_at(self, self->components) + newest * HSEP_N_COMPONENTS;
    double seen[HSEP_N_COMPONENTS] = {0.0}, total[HSEP_N_COMPONENTS] = {0.0};
    uncertainty_sums sums = {0};
    for (uint64_t j = 0; j < self->Np; j++) {
        if (accepted == NULL || accepted[j] > 0.0) {
            uncertainty_add(&sums, e[j], e[j] - e_h[j], std[j], uncertainty_from_middle(self, self->Np - 1 - j));
        }
    }
    if (!(sums.squares > 0.0)) { /* nothing to learn a scale from */
        return;
    }
    uncertainty_follow(self, &sums);
    for (uint64_t j = 0; j < self->Np; j++, f += HSEP_N_COMPONENTS) {
        if (accepted == NULL || accepted[j] > 0.0) {
            const double variance = uncertainty_variance(self, f);
            const double error = e[j] - e_h[j], relative = fmin(error * error / variance, HSEP_UNCERTAINTY_OUTLYING);
            for (int i = 0; i < HSEP_N_COMPONENTS; i++) {
                const double share = f[i] * self->theta[i] / variance;
                total[i] += share;
                seen[i] += share * relative;
            }
        }
    }
    uncertainty_step_by(self, seen, total);
}

/* Uncertainty of a prediction: the variance of its error against the measured position, learned from earlier windows;
 * as predict/uncertainty.py, which says how and why. Signals are kept newest first (hsep_window.h). Cost of a window:
 * 50 n operations each. */
#ifndef HSEP_UNCERTAINTY_H
#define HSEP_UNCERTAINTY_H

#include "hsep_layout.h"
#include "hsep_predict_constants.h"

#define HSEP_N_UNCERTAINTY (2 * HSEP_UNCERTAINTY_N_COMPONENTS + 3) /* numbers that are learned, each >= 0 */

typedef struct {
    hsep_int Np;
    hsep_real theta[HSEP_UNCERTAINTY_N_COMPONENTS];    /* variance of the noise, m2; others relative to their causes */
    hsep_real evidence[HSEP_UNCERTAINTY_N_COMPONENTS]; /* effective number of windows of each theta */
    hsep_real factor;                                  /* c in the middle of a window */
    hsep_real ratio;                                   /* c at its end relative to that at its beginning */
    hsep_real recent; /* m2, recent mean square of the residual; 0 before the first window */
    hsep_int n;       /* samples that are predicted */
    hsep_real least;  /* m, what is published at least: the largest residual, if the last ones were rejected */
    hsep_real felt[HSEP_UNCERTAINTY_N_COMPONENTS]; /* m2, components averaged over time, up to the last sample */
    hsep_int e_h;                                  /* (n,) m, residual of the window as published */
    hsep_int components; /* (n, HSEP_UNCERTAINTY_N_COMPONENTS) m2 but for the first, which is 1 */
    hsep_int std;        /* (n,) m, standard deviation of the error */
} hsep_uncertainty;
HSEP_ASSERT_WORDS(hsep_uncertainty, 6 + HSEP_UNCERTAINTY_N_COMPONENTS + HSEP_N_UNCERTAINTY);

static const hsep_real uncertainty_shares[] = {HSEP_UNCERTAINTY_SHARES};
static const hsep_real uncertainty_levels[][2] = {HSEP_UNCERTAINTY_LEVELS};

static inline hsep_real hsep_uncertainty_lay_out(hsep_uncertainty *self, hsep_int Np, hsep_int n)
{
    hsep_real end = HSEP_WORDS(hsep_uncertainty);
    self->Np = Np;
    self->n = n;
    self->e_h = hsep_take(&end, (hsep_real)n);
    self->components = hsep_take(&end, (hsep_real)n * HSEP_UNCERTAINTY_N_COMPONENTS);
    self->std = hsep_take(&end, (hsep_real)n);
    return end * sizeof(hsep_real);
}

/* Variance of the measurement noise before the first window is measured, m2. lambda: m2; noise_std: m, or 0. */
static inline hsep_real hsep_uncertainty_first_variance(hsep_real lambda, hsep_real noise_std)
{
    return noise_std > 0.0 ? hsep_fmax(lambda, noise_std * noise_std)
                           : hsep_fmin(HSEP_UNCERTAINTY_UNKNOWN_NOISE * lambda, HSEP_PREDICTION_MAX);
}

/* Fill the block. variance: that first one. */
static inline void hsep_uncertainty_init(hsep_uncertainty *self, hsep_int Np, hsep_int n, hsep_real variance)
{
    memset(self, 0, (size_t)hsep_uncertainty_lay_out(self, Np, n));
    (void)hsep_uncertainty_lay_out(self, Np, n);
    self->theta[0] = variance;
    memcpy(self->theta + 1, uncertainty_shares, sizeof uncertainty_shares);
    self->factor = self->ratio = 1.0;
}

/* Variance of the error with these components. */
static inline hsep_real uncertainty_variance(const hsep_uncertainty *self, const hsep_real components[])
{
    return hsep_dot(self->theta, components, HSEP_UNCERTAINTY_N_COMPONENTS) +
           (HSEP_UNCERTAINTY_FLOOR * self->recent + HSEP_UNCERTAINTY_LEAST_VARIANCE);
}

/* Place of sample k in a usual window, from -1/2 at its beginning to 1/2 at its end. */
static inline hsep_real uncertainty_from_middle(const hsep_uncertainty *self, hsep_int k)
{
    return hsep_fmin(((hsep_real)k + 0.5) / (hsep_real)self->Np, 1.0) - 0.5;
}

/* Predict the errors of samples first ... last - 1; first is 0, or where the last call ended. The first samples are at
 * least two, or n, as differences are taken. x_pb, e_h: (n,) m, physics-based prediction and predicted residual, which
 * is not published in n_physics leading samples; variance: (n,) m2, what is known of its error, or NULL. */
static inline void hsep_uncertainty_predict(
    hsep_uncertainty *self, const hsep_real x_pb[], const hsep_real e_h[], const hsep_real variance[],
    hsep_int n_physics, hsep_int first, hsep_int last)
{
    const hsep_int n = self->n;
    const hsep_real gain = 1.0 / (1.0 + HSEP_UNCERTAINTY_FELT_FOR * (hsep_real)self->Np);
    hsep_real *published = hsep_at(self, self->e_h), *std = hsep_at(self, self->std), *felt = self->felt;
    if (first == 0) {
        memset(felt, 0, sizeof self->felt);
    }
    for (hsep_int k = first; k < last; k++) { /* in time, from the last measured sample on */
        const hsep_int j = n - 1 - k;
        /* The first sample has the difference of the second. */
        const hsep_int newer = k == 0 && j > 0 ? j - 1 : j, older = newer + 1 < n ? newer + 1 : newer;
        const hsep_real change = hsep_fmin(hsep_fabs(x_pb[newer] - x_pb[older]), HSEP_PREDICTION_MAX);
        hsep_real *f = hsep_at(self, self->components) + j * HSEP_UNCERTAINTY_N_COMPONENTS;
        published[j] = k < n_physics ? 0.0 : e_h[j];
        f[0] = 1.0;
        f[1] = change * change;
        f[2] = variance != NULL && k >= n_physics ? variance[j] : 0.0;
        for (int i = 1; i < HSEP_UNCERTAINTY_N_COMPONENTS; i++) { /* all but the noise */
            felt[i] += gain * (f[i] - felt[i]);
            f[i] = felt[i];
        }
        const hsep_real c = self->factor * hsep_pow(self->ratio, uncertainty_from_middle(self, k));
        std[j] = hsep_fmin(c * hsep_sqrt(uncertainty_variance(self, f)), HSEP_PREDICTION_MAX);
    }
}

/* What is summed over the samples that count. */
typedef struct {
    hsep_real count, squares, errors; /* samples; squares of residuals and errors, m2 */
    hsep_real missed, missed_late;    /* beyond the intervals, more than there may be; weighted by their place */
} uncertainty_sums;

/* Add a sample that is measured. */
static inline void uncertainty_add(uncertainty_sums *sums, hsep_real e, hsep_real error, hsep_real std, hsep_real place)
{
    hsep_real missed = 0.0;
    for (size_t i = 0; i < sizeof uncertainty_levels / sizeof *uncertainty_levels; i++) {
        missed += (hsep_fabs(error) / std > uncertainty_levels[i][0] ? 1.0 : 0.0) - uncertainty_levels[i][1];
    }
    sums->count += 1.0;
    sums->squares += e * e;
    sums->errors += error * error;
    sums->missed += missed;
    sums->missed_late += missed * place;
}

/* Follow the size of residuals and the shares of errors beyond intervals, from the first window's mean square on. */
static inline void uncertainty_follow(hsep_uncertainty *self, const uncertainty_sums *sums)
{
    const hsep_real count = sums->count, mean_square = hsep_fmin(sums->squares / count, HSEP_PREDICTION_MAX);
    if (self->recent > 0.0) {
        const hsep_real factor = self->factor * hsep_exp(HSEP_UNCERTAINTY_FACTOR_RATE * (sums->missed / count));
        const hsep_real ratio = self->ratio * hsep_exp(HSEP_UNCERTAINTY_RATIO_RATE * (sums->missed_late / count));
        self->factor = hsep_fmin(hsep_fmax(factor, 1.0 / HSEP_UNCERTAINTY_FACTOR_MAX), HSEP_UNCERTAINTY_FACTOR_MAX);
        self->ratio = hsep_fmin(hsep_fmax(ratio, 1.0 / HSEP_UNCERTAINTY_RATIO_MAX), HSEP_UNCERTAINTY_RATIO_MAX);
        self->recent = HSEP_UNCERTAINTY_RECENT * self->recent + (1.0 - HSEP_UNCERTAINTY_RECENT) * mean_square;
    } else {
        self->recent = mean_square;
        self->ratio = HSEP_UNCERTAINTY_RATIO;
        self->theta[0] = hsep_fmin(sums->errors / count, HSEP_PREDICTION_MAX);
    }
}

/* A step of expectation maximisation. seen, total: sums of each component's share, with and without squared errors. */
static inline void uncertainty_step_by(
    hsep_uncertainty *self, const hsep_real seen[HSEP_UNCERTAINTY_N_COMPONENTS],
    const hsep_real total[HSEP_UNCERTAINTY_N_COMPONENTS])
{
    for (int i = 0; i < HSEP_UNCERTAINTY_N_COMPONENTS; i++) {
        const hsep_real windows = total[i] / (hsep_real)self->Np;
        const hsep_real share = i > 0 ? uncertainty_shares[i - 1] : 0.0;
        const hsep_real least = i > 0 ? HSEP_UNCERTAINTY_LEAST_SHARE * share : HSEP_UNCERTAINTY_FLOOR * self->recent;
        const hsep_real most = i > 0 ? HSEP_UNCERTAINTY_MOST_SHARE * share : HSEP_PREDICTION_MAX;
        self->evidence[i] = HSEP_UNCERTAINTY_MEMORY * self->evidence[i] + windows;
        const hsep_real change = hsep_fmax(total[i] > 0.0 ? seen[i] / total[i] : 1.0, HSEP_UNCERTAINTY_VANISHING);
        const hsep_real step =
            hsep_fmin(HSEP_UNCERTAINTY_STEP * windows / (self->evidence[i] + HSEP_UNCERTAINTY_FIRST_EVIDENCE), 1.0);
        const hsep_real theta = self->theta[i] * hsep_pow(change, step);
        self->theta[i] = hsep_fmin(hsep_fmax(theta, least), most);
    }
}

/* Learn from measured residuals e, (Np,), m, of its first samples; accepted: (Np,), 1 where one counts; NULL: all. */
static inline void hsep_uncertainty_learn(hsep_uncertainty *self, const hsep_real e[], const hsep_real accepted[])
{
    const hsep_int newest = self->n - self->Np; /* place of the last one that is measured */
    const hsep_real *e_h = hsep_at(self, self->e_h) + newest, *std = hsep_at(self, self->std) + newest;
    const hsep_real *f = hsep_at(self, self->components) + newest * HSEP_UNCERTAINTY_N_COMPONENTS;
    hsep_real seen[HSEP_UNCERTAINTY_N_COMPONENTS] = {0.0}, total[HSEP_UNCERTAINTY_N_COMPONENTS] = {0.0};
    uncertainty_sums sums = {0};
    for (hsep_int j = 0; j < self->Np; j++) {
        if (accepted == NULL || accepted[j] > 0.0) {
            uncertainty_add(&sums, e[j], e[j] - e_h[j], std[j], uncertainty_from_middle(self, self->Np - 1 - j));
        }
    }
    if (!(sums.squares > 0.0)) { /* nothing to learn a scale from */
        return;
    }
    uncertainty_follow(self, &sums);
    for (hsep_int j = 0; j < self->Np; j++, f += HSEP_UNCERTAINTY_N_COMPONENTS) {
        if (accepted == NULL || accepted[j] > 0.0) {
            const hsep_real variance = uncertainty_variance(self, f);
            const hsep_real error = e[j] - e_h[j],
                            relative = hsep_fmin(error * error / variance, HSEP_UNCERTAINTY_OUTLYING);
            for (int i = 0; i < HSEP_UNCERTAINTY_N_COMPONENTS; i++) {
                const hsep_real share = f[i] * self->theta[i] / variance;
                total[i] += share;
                seen[i] += share * relative;
            }
        }
    }
    uncertainty_step_by(self, seen, total);
}

#endif

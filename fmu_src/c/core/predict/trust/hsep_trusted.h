/* Residual model that can be trusted: features with priors, candidates shrunk by their variance, and their blend.
 *
 * Where the paper's regression has one bare penalty lambda on every weight, here each weight has a prior from the
 * effect that its feature may have, and lambda is the variance of the noise, estimated from the residuals.
 *
 * A window is predicted by hsep_trusted_forecast, and learned by hsep_trusted_learn once it is measured. A compensator,
 * which decides the commands of a window, calls hsep_trusted_scale and, for commands that it tries over its preview,
 * hsep_trusted_predict; the last ones count. Signals are kept newest first: of n samples, sample k is at place
 * n - 1 - k, and what was before them is behind them. Positions are relative to the start. Memory is one block, without
 * pointers; a window predicted and not measured yet is part of it. Reentrant; allocates nothing.
 */
#ifndef HSEP_TRUSTED_H
#define HSEP_TRUSTED_H

#include "hsep_api.h"
#include "hsep_blend.h"
#include "hsep_candidate.h"
#include "hsep_change.h"
#include "hsep_disturbances.h"
#include "hsep_guard.h"
#include "hsep_layout.h"
#include "hsep_penalised.h"
#include "hsep_physics.h"
#include "hsep_regression.h"
#include "hsep_settings.h"

#include <stdint.h>

#define HSEP_N_CANDIDATES 3 /* without lags, with lags, with lags and rows taken as independent */

typedef struct {
    const hsep_predictor_settings *settings;
    const hsep_trust_settings *trust;
    const hsep_mode *modes; /* (n_modes,) */
    uint64_t n_modes;
    uint64_t
        n; /* samples of a prediction: of a window, or a compensator's preview, and before it those that are late */
    int planned; /* whether a compensator decides the commands */
} hsep_trusted_parameters;

typedef struct {
    uint64_t Np, n, p, n_static; /* samples of a window and of a prediction, lags, features without lags */
    double least_variance;       /* m2, of the noise */
    double effect;               /* m, prior standard deviation of a feature's effect; 0: from the residuals */
    double given_variance;       /* m2, of the noise; 0: estimated */
    double kept;                 /* weight of earlier rows, from window to window */
    /* Learned */
    double n_rows;         /* weighted */
    double velocity_scale; /* m/s */
    hsep_residual_scale scale;
    hsep_blend blend;
    double correlations[HSEP_N_CANDIDATES]; /* of the candidates, as this run began */
    /* Of the window that is predicted */
    double hold;           /* m, last residual */
    double forecast_scale; /* m/s, its velocity scale */
    uint64_t predicted;    /* whether the candidates predicted it */
    hsep_guard guard;
    uint64_t n_rejected; /* samples of this run that were not accepted */
    uint64_t at_rest;    /* whether the command has not moved in this run yet, in what was learned, */
    uint64_t known_rest; /* how many samples behind these are at rest as well (0 if it has), */
    uint64_t n_rest;     /* and how many of those predicted, the first ones */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t largest;          /* (n_static,) largest magnitudes of the features without lags */
    uint64_t forecast_largest; /* (n_static,) those with the window that is predicted */
    uint64_t scales;           /* (n_static,) prior standard deviations of their weights */
    uint64_t x;                /* (n,) m, position */
    uint64_t measured;         /* (Np,) m, measured position, NaN where missing */
    uint64_t accepted;         /* (Np,) whether it is plausible */
    uint64_t bridged;          /* (Np + p,) whether a residual stands for one that is not */
    uint64_t disagreement;     /* (n,) m2, variance of the candidates about their blend */
    uint64_t rows;             /* (n, n_static) features without lags, sample after sample */
    uint64_t disturbances, regression, change;
    uint64_t candidates[HSEP_N_CANDIDATES];
} hsep_trusted;

HSEP_ASSERT_WORDS(hsep_trusted, 62 + sizeof(hsep_guard) / 8);

/* Features, those without lags first. */
HSEP_API uint64_t hsep_trusted_n(const hsep_predictor_settings *settings, const hsep_trust_settings *trust);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_trusted_size(const hsep_trusted_parameters *parameters);

/* Fill the block, at rest at start, m, with nothing learned. */
HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_trusted_parameters *parameters, double start);

/* Whether a block, in any alignment, is one that hsep_trusted_init with these parameters began. */
HSEP_API int hsep_trusted_valid(const void *block, const hsep_trusted_parameters *parameters);

/* The regression of all rows. */
HSEP_API hsep_regression *hsep_trusted_regression(hsep_trusted *self);

HSEP_API hsep_disturbances *hsep_trusted_disturbances(hsep_trusted *self);
HSEP_API hsep_change *hsep_trusted_change(hsep_trusted *self);
HSEP_API hsep_candidate *hsep_trusted_candidate(hsep_trusted *self, uint64_t i);

/* Least variance of the noise, m2. */
HSEP_API double hsep_trusted_least_variance(const hsep_trusted *self);

/* The numbers learned besides it, for a warm start before the first window: their count, and the place of one of them.
 * These are, each >= 0: n_rows, velocity_scale, the scale of the residuals as in its struct, the noise variances of the
 * candidates, their correlations, the blend's weights and largest; then the blend's gram and cross, and what is known
 * of the sensor: its spread, -1 where it is not known, its step, then infinite, its stuck and vibration. */
HSEP_API uint64_t hsep_trusted_n_learned(const hsep_trusted *self);
HSEP_API double *hsep_trusted_learned(hsep_trusted *self, uint64_t i);

/* Whether these numbers are finite and in range. */
HSEP_API int hsep_trusted_sound(hsep_trusted *self);

/* Predict the residual e, (n + p,), m, in samples 0 ... last - 1 of those that come next; behind it the last ones, as
 * measured. x_d: commands, x_pb: physics-based prediction, (n,), m. Cost: m^3 / 6 multiply-adds for each candidate's m
 * features, last m^2 / 2, last n / 2, and 6 n tanh. */
HSEP_API void hsep_trusted_forecast(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t last);

/* Predict samples first ... last - 1, too: their variances are dear, and nobody asks for them before. */
HSEP_API void hsep_trusted_go_on(hsep_trusted *self, double e[], uint64_t first, uint64_t last);

/* What a compensator needs of it, over n samples. Take the scales of the features from the samples that come next, and
 * solve for the weights; path: unmodified commands of the last n_path of these, m, of a compensator; or NULL. */
HSEP_API void hsep_trusted_scale(
    hsep_trusted *self, const double x_d[], const double x_pb[], const double path[], uint64_t n_path,
    double last_residual);

/* Predict with them. e: (n + p,), m; varied: samples whose variance is computed, the first ones, while the prediction
 * of those behind them means nothing yet; 0: variances and shrinking stay those of the last prediction. */
HSEP_API void hsep_trusted_predict(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t varied);

/* Compute the variances of samples first ... last - 1 of that prediction, which the next one may hold. */
HSEP_API void hsep_trusted_vary(hsep_trusted *self, uint64_t first, uint64_t last);

/* In a warm run: predict the window once more, with less weight of earlier runs, for comparison. It is done after the
 * beginning of a window, where it is predicted and planned, to spread the work. past: (p,) m, the residuals before the
 * window. Cost: that of hsep_change_predict. */
HSEP_API void hsep_trusted_predict_less(hsep_trusted *self, const double past[]);

/* Take the measured position of sample k of the window that was predicted, m, relative to the start; NaN: missing. */
HSEP_API void hsep_trusted_measure(hsep_trusted *self, uint64_t k, double x);

/* Begin the run of that window, its first one, in motion: x_d and x_pb, (Np,), m, with the motion before it. */
HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const double x_d[], const double x_pb[]);

/* Learn that window. x_d: its commands, (Np,), m; e: (Np + p,), m, becomes its residuals; where the measurement is not
 * plausible, between those beside it; behind it those before it; fold: whether it is learned, the next window starts
 * from it in any case. Cost: Np times that of hsep_regression_fold; in a warm run those of hsep_change_join and
 * hsep_change_tells, too. */
HSEP_API void hsep_trusted_learn(hsep_trusted *self, const double x_d[], const double x_pb[], double e[], int fold);

/* Discount what earlier runs have learned, and compare it with what this one teaches: a machine may have changed
 * meanwhile. */
HSEP_API void hsep_trusted_restart(hsep_trusted *self);

#endif

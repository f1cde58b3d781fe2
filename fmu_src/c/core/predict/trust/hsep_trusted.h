/* Residual model that can be trusted: the paper's regression twice, stacked with physics and hold.
 *
 * e_pb = x - x_pb of a window is predicted by physics (0), hold (the last residual), by static features with lags and
 * without, and by eq. (4) with G_pb = 1, on the residual of the command itself, which saves a user whose physics model
 * is poor. Their sum is weighted by their errors so far. Where the paper's regression has one bare penalty lambda on
 * every weight, here each weight has a prior from the effect that its feature may have, and lambda is the least
 * variance of the noise.
 *
 * A window is predicted by hsep_trusted_forecast, and learned by hsep_trusted_learn once it is measured. A compensator,
 * which decides the commands of a window, begins with the rest of its last plan, and calls hsep_trusted_predict for
 * other commands that it tries over its preview; the last ones count. Signals are kept newest first: of n samples,
 * sample k is at place n - 1 - k, and what was before them is behind them. Positions are relative to the start. Memory
 * is one block, without pointers; a window predicted and not measured yet is part of it. Reentrant; allocates nothing.
 */
#ifndef HSEP_TRUSTED_H
#define HSEP_TRUSTED_H

#include "hsep_api.h"
#include "hsep_command.h"
#include "hsep_disturbances.h"
#include "hsep_expert.h"
#include "hsep_gram.h"
#include "hsep_layout.h"
#include "hsep_physics.h"
#include "hsep_reach.h"
#include "hsep_settings.h"
#include "hsep_stack.h"

#include <stdint.h>

typedef struct {
    const hsep_predictor_settings *settings;
    const hsep_trust_settings *trust;
    const hsep_mode *modes; /* (n_modes,) */
    uint64_t n_modes;
    uint64_t
        n; /* samples of a prediction: of a window, or a compensator's preview, and before it those that are late */
    int planned; /* whether a compensator decides the commands */
} hsep_trusted_parameters;

/* Rows that experts have learned: of the physics model's residual, and of the command's. */
typedef enum { HSEP_OF_PHYSICS = 0, HSEP_OF_COMMAND } hsep_evidence;

#define HSEP_N_EVIDENCE 2

/* Samples of a window that are learned at one: those catch up that were measured before it was predicted. */
#define HSEP_TRUSTED_PACE 2

typedef struct {
    uint64_t Np, n, p, n_static; /* samples of a window and of a prediction, lags, features without lags */
    uint64_t late;               /* samples by which the measurement is late */
    double T_s;                  /* s */
    double least_variance;       /* m2, of the noise */
    double effect;               /* m, prior standard deviation of a feature's effect; 0: from the residuals */
    double given_variance;       /* m2, of the noise; 0: estimated */
    double kept;                 /* weight of earlier rows, from window to window */
    /* Learned */
    double n_rows[HSEP_N_EVIDENCE];    /* of this run, weighted */
    double n_earlier[HSEP_N_EVIDENCE]; /* of earlier runs, as long as they are doubted */
    double velocity_scale;             /* m/s */
    double largest_step;               /* m, largest change of the command from sample to sample */
    hsep_residual_scale scale, scale_of_command;
    hsep_stack stack;
    /* Of the window that is predicted */
    double hold;                        /* m, last residual, bounded */
    double forecast_scale;              /* m/s, velocity scale with it, */
    double forecast_step;               /* m, and largest change of the command */
    double bound;                       /* m, on what is predicted, */
    double growth;                      /* and by how much that of the command may be larger: as its largest step is */
    uint64_t predicted[HSEP_N_EXPERTS]; /* whether an expert knows something */
    uint64_t leading; /* expert that led when earlier runs ended, HSEP_LAGGED or HSEP_COMMAND: its counterpart doubts */
    hsep_reach reach;
    uint64_t n_rejected; /* samples of this run that were not accepted */
    /* Of the window that is measured */
    uint64_t followed; /* samples that were judged and, as far as they are believed, learned */
    uint64_t known;    /* samples up to the last one that is believed */
    double n_accepted; /* samples that are */
    hsep_reach_window reach_of_window;
    /* Offsets in doubles from the beginning of the struct */
    uint64_t largest;          /* (n_static,) largest magnitudes of the features without lags */
    uint64_t forecast_largest; /* (n_static,) those with the window that is predicted */
    uint64_t scales;           /* (max(n_static, p of the command + 2),) prior standard deviations of weights, work */
    uint64_t x;                /* (n,) m, position */
    uint64_t measured;         /* (Np,) m, measured position, NaN where missing */
    uint64_t accepted;         /* (Np,) whether it is believed */
    uint64_t bridged;          /* (Np + max(p, p of the command),) whether a residual stands for one that is not */
    uint64_t e_0;              /* (Np + p of the command,) m, residual of the command */
    uint64_t stacked;          /* (2, n) m, what the command's expert and the doubting one, where it is of the command,
                                * predict of that of the physics model */
    uint64_t variance;         /* (n,) m2, of the mixture of the experts */
    uint64_t rows;             /* (n, n_static) features without lags, sample after sample */
    uint64_t disturbances, command;
    uint64_t evidence[HSEP_N_EVIDENCE]; /* Gram matrices of this run's rows, */
    uint64_t earlier[HSEP_N_EVIDENCE];  /* and of those of earlier runs */
    uint64_t experts[HSEP_N_EXPERTS];   /* hold has none, 0 */
} hsep_trusted;

HSEP_ASSERT_WORDS(
    hsep_trusted, 39 + 4 * HSEP_N_EVIDENCE + 2 * HSEP_N_EXPERTS +
                      (sizeof(hsep_stack) + sizeof(hsep_reach) + sizeof(hsep_reach_window)) / sizeof(double));

/* Features, those without lags first. */
HSEP_API uint64_t hsep_trusted_n(const hsep_predictor_settings *settings, const hsep_trust_settings *trust);

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_trusted_size(const hsep_trusted_parameters *parameters);

/* Fill the block, at rest at start, m, with nothing learned. */
HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_trusted_parameters *parameters, double start);

/* Whether a block, in any alignment, is one that hsep_trusted_init with these parameters began. */
HSEP_API int hsep_trusted_valid(const void *block, const hsep_trusted_parameters *parameters);

HSEP_API hsep_gram *hsep_trusted_evidence(hsep_trusted *self, hsep_evidence evidence);
HSEP_API hsep_gram *hsep_trusted_earlier(hsep_trusted *self, hsep_evidence evidence);
HSEP_API hsep_disturbances *hsep_trusted_disturbances(hsep_trusted *self);
HSEP_API hsep_command *hsep_trusted_command(hsep_trusted *self);

/* An expert; not hold. */
HSEP_API hsep_expert *hsep_trusted_expert(hsep_trusted *self, hsep_expert_place expert);

/* Whether an expert predicts the residual of the command. */
HSEP_API int hsep_trusted_is_of_command(const hsep_trusted *self, uint64_t expert);

/* Let the doubting expert be the counterpart of HSEP_LAGGED or HSEP_COMMAND, with nothing learned. */
HSEP_API void hsep_trusted_lead(hsep_trusted *self, hsep_expert_place expert);

/* What an expert predicts of the sample at a place, m; 0 where it knows nothing. */
HSEP_API double hsep_trusted_stacked(const hsep_trusted *self, hsep_expert_place expert, uint64_t place);

/* The numbers learned besides the factors, for a warm start before the first window: their count, and the place of one
 * of them. Their order is that of LEARNED in hybridsep/predict/trust/learned.py. */
HSEP_API uint64_t hsep_trusted_n_learned(hsep_trusted *self);
HSEP_API double *hsep_trusted_learned(hsep_trusted *self, uint64_t i);

/* Whether these numbers are in range. */
HSEP_API int hsep_trusted_sound(hsep_trusted *self);

/* Whether this run doubts earlier ones. */
HSEP_API int hsep_trusted_doubts(const hsep_trusted *self);

/* Forget all rows of some evidence; go on with all of them as with those of this run; weigh all so far by kept; begin
 * another run, of which all so far are earlier ones, at a bounded weight. */
HSEP_API void hsep_trusted_forget(hsep_trusted *self, hsep_evidence evidence);
HSEP_API void hsep_trusted_believe_earlier(hsep_trusted *self, hsep_evidence evidence);
HSEP_API void hsep_trusted_discount(hsep_trusted *self, hsep_evidence evidence, double kept);
HSEP_API void hsep_trusted_begin_run(hsep_trusted *self, hsep_evidence evidence);

/* Predict the residual e, (n + p,), m, in samples 0 ... last - 1 of those that come next; behind it the last ones, as
 * measured. x_d: commands, x_pb: physics-based prediction, (n,), m; path: unmodified commands of the last n_path of
 * them, m, of a compensator; or NULL. Cost: m^3 / 6 multiply-adds for each expert's m features, last m^2 / 2, last
 * n / 2, and 6 n tanh. */
HSEP_API void hsep_trusted_forecast(
    hsep_trusted *self, const double x_d[], const double x_pb[], const double path[], uint64_t n_path, double e[],
    uint64_t last);

/* Predict samples first ... last - 1, too: their variances are dear, and nobody asks for them before. */
HSEP_API void hsep_trusted_go_on(hsep_trusted *self, const double x_pb[], double e[], uint64_t first, uint64_t last);

/* Predict other commands with the same scales and weights. e: (n + p,), m; varied: samples whose variance is computed,
 * the first ones, while the prediction of those behind them means nothing yet; 0: shrinking stays that of the last
 * prediction. */
HSEP_API void hsep_trusted_predict(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t varied);

/* Compute the variances of samples first ... last - 1 of that prediction, which the next one may hold. */
HSEP_API void hsep_trusted_vary(hsep_trusted *self, uint64_t first, uint64_t last);

/* Take the measured position of sample k of the window that was predicted, m, relative to the start; NaN: missing. */
HSEP_API void hsep_trusted_measure(hsep_trusted *self, uint64_t k, double x);

/* Begin the run of that window, its first one, in motion: x_d and x_pb, (Np,), m, Np > 1, with the motion before it. */
HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const double x_d[], const double x_pb[]);

/* Follow that window as it is measured: judge and learn its samples up to last - 1, HSEP_TRUSTED_PACE of them in a
 * call. All of the window must have been predicted. x_d: its commands, (Np,), m; e: (Np + p,), m, becomes its
 * residuals; where the measurement is not believed, between those beside it; behind it those before it. Cost for a
 * sample: that of hsep_gram_fold, of physics and of command. */
HSEP_API void hsep_trusted_follow(
    hsep_trusted *self, const double x_d[], const double x_pb[], double e[], uint64_t last);

/* Learn the rest of that window, and judge the experts by it. fold: whether it is learned, as it was followed if so;
 * the next window starts from it in any case. */
HSEP_API void hsep_trusted_learn(hsep_trusted *self, const double x_d[], const double x_pb[], double e[], int fold);

/* Discount what earlier runs have learned, and begin to doubt it: a machine may have changed meanwhile. */
HSEP_API void hsep_trusted_restart(hsep_trusted *self);

#endif

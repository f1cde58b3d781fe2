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
#include "hsep_real.h"
#include "hsep_settings.h"
#include "hsep_stack.h"

typedef struct {
    const hsep_predictor_settings *settings;
    const hsep_trust_settings *trust;
    const hsep_mode *modes; /* (n_modes,) */
    hsep_word n_modes;
    hsep_word
        n; /* samples of a prediction: of a window, or a compensator's preview, and before it those that are late */
    int planned; /* whether a compensator decides the commands */
} hsep_trusted_parameters;

/* Rows that experts have learned: of the physics model's residual, and of the command's. */
typedef enum { HSEP_OF_PHYSICS = 0, HSEP_OF_COMMAND } hsep_evidence;

#define HSEP_N_EVIDENCE 2

/* Samples of a window that are learned at one: those catch up that were measured before it was predicted. */
#define HSEP_TRUSTED_PACE 2

typedef struct {
    hsep_word Np, n, p, n_static; /* samples of a window and of a prediction, lags, features without lags */
    hsep_word late;               /* samples by which the measurement is late */
    hsep_real T_s;                /* s */
    hsep_real least_variance;     /* m2, of the noise */
    hsep_real effect;             /* m, prior standard deviation of a feature's effect; 0: from the residuals */
    hsep_real given_variance;     /* m2, of the noise; 0: estimated */
    hsep_real kept;               /* weight of earlier rows, from window to window */
    /* Learned */
    hsep_real n_rows[HSEP_N_EVIDENCE];    /* of this run, weighted */
    hsep_real n_earlier[HSEP_N_EVIDENCE]; /* of earlier runs, as long as they are doubted */
    hsep_real velocity_scale;             /* m/s */
    hsep_real largest_step;               /* m, largest change of the command from sample to sample */
    hsep_residual_scale scale, scale_of_command;
    hsep_stack stack;
    /* Of the window that is predicted */
    hsep_real hold;                      /* m, last residual, bounded */
    hsep_real forecast_scale;            /* m/s, velocity scale with it, */
    hsep_real forecast_step;             /* m, and largest change of the command */
    hsep_real bound;                     /* m, on what is predicted, */
    hsep_real growth;                    /* and by how much that of the command may be larger: as its largest step is */
    hsep_word predicted[HSEP_N_EXPERTS]; /* whether an expert knows something */
    hsep_word
        leading; /* expert that led when earlier runs ended, HSEP_LAGGED or HSEP_COMMAND: its counterpart doubts */
    hsep_reach reach;
    hsep_word n_rejected; /* samples of this run that were not accepted */
    /* Of the window that is measured */
    hsep_word followed;   /* samples that were judged and, as far as they are believed, learned */
    hsep_word known;      /* samples up to the last one that is believed */
    hsep_real n_accepted; /* samples that are */
    hsep_reach_window reach_of_window;
    /* Offsets in words from the beginning of the struct */
    hsep_word largest;          /* (n_static,) largest magnitudes of the features without lags */
    hsep_word forecast_largest; /* (n_static,) those with the window that is predicted */
    hsep_word scales;           /* (max(n_static, p of the command + 2),) prior standard deviations of weights, work */
    hsep_word x;                /* (n,) m, position */
    hsep_word measured;         /* (Np,) m, measured position, NaN where missing */
    hsep_word accepted;         /* (Np,) whether it is believed */
    hsep_word bridged;          /* (Np + max(p, p of the command),) whether a residual stands for one that is not */
    hsep_word e_0;              /* (Np + p of the command,) m, residual of the command */
    hsep_word stacked;          /* (2, n) m, what the command's expert and the doubting one, where it is of the command,
                                * predict of that of the physics model */
    hsep_word variance;         /* (n,) m2, of the mixture of the experts */
    hsep_word rows;             /* (n, n_static) features without lags, sample after sample */
    hsep_word disturbances, command;
    hsep_word evidence[HSEP_N_EVIDENCE]; /* Gram matrices of this run's rows, */
    hsep_word earlier[HSEP_N_EVIDENCE];  /* and of those of earlier runs */
    hsep_word experts[HSEP_N_EXPERTS];   /* hold has none, 0 */
} hsep_trusted;

HSEP_ASSERT_WORDS(
    hsep_trusted, 39 + 4 * HSEP_N_EVIDENCE + 2 * HSEP_N_EXPERTS +
                      (sizeof(hsep_stack) + sizeof(hsep_reach) + sizeof(hsep_reach_window)) / sizeof(hsep_real));

/* Features, those without lags first. */
HSEP_API hsep_word hsep_trusted_n(const hsep_predictor_settings *settings, const hsep_trust_settings *trust);

/* Bytes of the block, counted as a number so that no size can overflow. */
HSEP_API hsep_real hsep_trusted_size(const hsep_trusted_parameters *parameters);

/* Fill the block, at rest at start, m, with nothing learned. */
HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_trusted_parameters *parameters, hsep_real start);

/* Whether a block, in any alignment, is one that hsep_trusted_init with these parameters began. */
HSEP_API int hsep_trusted_valid(const void *block, const hsep_trusted_parameters *parameters);

HSEP_API hsep_gram *hsep_trusted_evidence(hsep_trusted *self, hsep_evidence evidence);
HSEP_API hsep_gram *hsep_trusted_earlier(hsep_trusted *self, hsep_evidence evidence);
HSEP_API hsep_disturbances *hsep_trusted_disturbances(hsep_trusted *self);
HSEP_API hsep_command *hsep_trusted_command(hsep_trusted *self);

/* An expert; not hold. */
HSEP_API hsep_expert *hsep_trusted_expert(hsep_trusted *self, hsep_expert_place expert);

/* Whether an expert predicts the residual of the command. */
HSEP_API int hsep_trusted_is_of_command(const hsep_trusted *self, hsep_word expert);

/* Let the doubting expert be the counterpart of HSEP_LAGGED or HSEP_COMMAND, with nothing learned. */
HSEP_API void hsep_trusted_lead(hsep_trusted *self, hsep_expert_place expert);

/* What an expert predicts of the sample at a place, m; 0 where it knows nothing. */
HSEP_API hsep_real hsep_trusted_stacked(const hsep_trusted *self, hsep_expert_place expert, hsep_word place);

/* The numbers learned besides the factors, for a warm start before the first window: their count, and the place of one
 * of them. Their order is that of LEARNED in hybridsep/predict/trust/learned.py. */
HSEP_API hsep_word hsep_trusted_n_learned(hsep_trusted *self);
HSEP_API hsep_real *hsep_trusted_learned(hsep_trusted *self, hsep_word i);

/* Whether these numbers are in range. */
HSEP_API int hsep_trusted_sound(hsep_trusted *self);

/* Whether this run doubts earlier ones. */
HSEP_API int hsep_trusted_doubts(const hsep_trusted *self);

/* Forget all rows of some evidence; go on with all of them as with those of this run; weigh all so far by kept; begin
 * another run, of which all so far are earlier ones, at a bounded weight. */
HSEP_API void hsep_trusted_forget(hsep_trusted *self, hsep_evidence evidence);
HSEP_API void hsep_trusted_believe_earlier(hsep_trusted *self, hsep_evidence evidence);
HSEP_API void hsep_trusted_discount(hsep_trusted *self, hsep_evidence evidence, hsep_real kept);
HSEP_API void hsep_trusted_begin_run(hsep_trusted *self, hsep_evidence evidence);

/* Predict the residual e, (n + p,), m, in samples 0 ... last - 1 of those that come next; behind it the last ones, as
 * measured. x_d: commands, x_pb: physics-based prediction, (n,), m; path: unmodified commands of the last n_path of
 * them, m, of a compensator; or NULL. Cost: m^3 / 6 multiply-adds for each expert's m features, last m^2 / 2, last
 * n / 2, and 6 n tanh. */
HSEP_API void hsep_trusted_forecast(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_word n_path,
    hsep_real e[], hsep_word last);

/* Predict samples first ... last - 1, too: their variances are dear, and nobody asks for them before. */
HSEP_API void hsep_trusted_go_on(
    hsep_trusted *self, const hsep_real x_pb[], hsep_real e[], hsep_word first, hsep_word last);

/* Predict other commands with the same scales and weights. e: (n + p,), m; varied: samples whose variance is computed,
 * the first ones, while the prediction of those behind them means nothing yet; 0: shrinking stays that of the last
 * prediction. */
HSEP_API void hsep_trusted_predict(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_word varied);

/* Compute the variances of samples first ... last - 1 of that prediction, which the next one may hold. */
HSEP_API void hsep_trusted_vary(hsep_trusted *self, hsep_word first, hsep_word last);

/* Take the measured position of sample k of the window that was predicted, m, relative to the start; NaN: missing. */
HSEP_API void hsep_trusted_measure(hsep_trusted *self, hsep_word k, hsep_real x);

/* Begin the run of that window, its first one, in motion: x_d and x_pb, (Np,), m, Np > 1, with the motion before it. */
HSEP_API void hsep_trusted_begin_in_motion(hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[]);

/* Follow that window as it is measured: judge and learn its samples up to last - 1, HSEP_TRUSTED_PACE of them in a
 * call. All of the window must have been predicted. x_d: its commands, (Np,), m; e: (Np + p,), m, becomes its
 * residuals; where the measurement is not believed, between those beside it; behind it those before it. Cost for a
 * sample: that of hsep_gram_fold, of physics and of command. */
HSEP_API void hsep_trusted_follow(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_word last);

/* Learn the rest of that window, and judge the experts by it. fold: whether it is learned, as it was followed if so;
 * the next window starts from it in any case. */
HSEP_API void hsep_trusted_learn(
    hsep_trusted *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], int fold);

/* Discount what earlier runs have learned, and begin to doubt it: a machine may have changed meanwhile. */
HSEP_API void hsep_trusted_restart(hsep_trusted *self);

#endif

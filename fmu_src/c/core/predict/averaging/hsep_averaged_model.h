/* Averaged residual model: experts of e_pb, stacked with physics and hold; as predict/averaging/model.py,
 * which says what they are.
 *
 * A window is predicted by hsep_averaged_forecast, and learned by hsep_averaged_learn once it is measured. A
 * compensator, which decides the commands of a window, begins with the rest of its last plan, and calls
 * hsep_averaged_predict for other commands that it tries over its preview; the last ones count. A window predicted and
 * not measured yet is part of the block. Positions are relative to the start, signals newest first (hsep_window.h).
 */
#ifndef HSEP_AVERAGED_MODEL_H
#define HSEP_AVERAGED_MODEL_H

#include "hsep_features.h"
#include "hsep_warm_start.h"
#include "hsep_experts.h"
#include "hsep_gate.h"
#include "hsep_recall.h"
#include "hsep_stacking.h"

/* Samples that are learned at each sample: two, to catch up with those measured before a window was all predicted. */
#define HSEP_AVERAGED_PACE 2

/* Multiply-adds as which an entry of a Gram matrix counts where four rows are added, and where a solution begins. */
#define HSEP_AVERAGED_OF_GRAM 5.0
#define HSEP_AVERAGED_OF_BEGINNING 4.0

/* Features without lags of an expert, at most. */
#define HSEP_AVERAGED_MOST \
    (HSEP_COMMAND_FEATURES > HSEP_DISTURBANCES_MOST ? HSEP_COMMAND_FEATURES : HSEP_DISTURBANCES_MOST)

/* What has been learned besides the rows: the numbers of a weights file, in this order, in the library, too. After
 * them are the largest magnitudes of the features without lags. */
typedef struct {
    hsep_real velocity_scale; /* m/s, of the friction features; 0 before any motion */
    hsep_real largest_step;   /* m, largest change from sample to sample, of the command */
    hsep_real fastest;        /* m, and of the physics model */
    hsep_residual_scale scales[HSEP_N_RESIDUALS];
    hsep_expert_errors errors[HSEP_N_REGRESSIONS]; /* of the regressions */
    hsep_stack stacks[HSEP_N_STACKS];
} hsep_learned;

typedef struct {
    hsep_int Np, n, p, n_static; /* samples of a window and of a prediction, lags, features without lags */
    hsep_int late;               /* samples by which the measurement is late */
    hsep_int solving_from;       /* samples of a window after which the next one's solutions may begin */
    hsep_real T_s;               /* s */
    hsep_real least_variance;    /* m2, of the noise */
    hsep_real effect;            /* m, prior standard deviation of a feature's effect; 0: from the residuals */
    hsep_real given_variance;    /* m2, of the noise; 0: estimated */
    hsep_real forgetting_factor; /* weight of earlier rows, from window to window */
    hsep_int leading;            /* expert that led when earlier runs ended, HSEP_ARX_RESIDUAL or HSEP_ARX_COMMAND */
    hsep_gate gate;
    hsep_int n_rejected;  /* samples of this run that were not accepted */
    hsep_int is_levelled; /* whether its first window is learned, */
    hsep_real level;      /* m, and the mean residual in it, if the command moved by little beside it, else 0 */
    /* Of the window that is predicted */
    hsep_real forecast_scale;           /* m/s, velocity scale with it, */
    hsep_real forecast_step;            /* m, and largest change of the command, */
    hsep_real bound;                    /* m, on what is predicted, */
    hsep_real growth;                   /* how much larger the command's bound may be, as its largest step is */
    hsep_int predicted[HSEP_N_EXPERTS]; /* whether an expert knows something */
    hsep_real alike;                    /* how much HSEP_RECALL counts */
    hsep_int weighs;                    /* stack that weighs now, HSEP_OF_PLANS while a plan is made */
    hsep_real others[HSEP_N_EXPERTS];   /* its weights of the others where HSEP_RECALL does not count, */
    hsep_real shares[HSEP_N_EXPERTS];   /* and of all as they count */
    /* Of the window that is measured */
    hsep_int followed;         /* samples that were judged and, as far as they are believed, learned */
    hsep_int known;            /* samples up to the last one that is believed */
    hsep_real n_accepted;      /* samples that are */
    hsep_int forecast_largest; /* (n_static,) largest magnitudes with the window that is predicted */
    hsep_int x;                /* (n,) m, position */
    hsep_int measured;         /* (Np,) m, measured position, relative to the start, NaN where missing */
    hsep_int accepted;         /* (Np,) whether it is believed */
    hsep_int e_0;              /* (Np + p of the command,) m, residual of the command */
    hsep_int stacked;          /* (HSEP_N_EXPERTS, n) m, what experts add to the physics model */
    hsep_int ahead;            /* (n_ahead, HSEP_N_EXPERTS, Np) m, what is stacked half a plan ahead, oldest first */
    hsep_int n_ahead;          /* windows of half a plan; 0 without a compensator */
    hsep_int recalled;         /* (n,) m, what HSEP_RECALL predicts */
    hsep_int e_h;              /* (n,) m, residual that is predicted */
    hsep_int variance;         /* (n,) m2, of the mixture of the experts */
    hsep_int rows;             /* (n, n_static) features without lags, sample after sample */
    hsep_int disturbances, command, recall;
    hsep_int evidence[HSEP_N_RESIDUALS];
    hsep_int experts[HSEP_N_EXPERTS]; /* hold has none, 0 */
    hsep_int largest;                 /* (n_static,) largest magnitudes of the features without lags */
    hsep_learned learned;
} hsep_averaged;

#define HSEP_LEARNED_WORDS (3 + 3 * HSEP_N_RESIDUALS + 2 * HSEP_N_REGRESSIONS + HSEP_N_STACKS * HSEP_STACK_WORDS)
HSEP_ASSERT_WORDS(hsep_learned, HSEP_LEARNED_WORDS);
HSEP_ASSERT_WORDS(
    hsep_averaged,
    40 + HSEP_N_RESIDUALS + 4 * HSEP_N_EXPERTS + HSEP_LEARNED_WORDS + sizeof(hsep_gate) / sizeof(hsep_real));

HSEP_API hsep_real hsep_averaged_lay_out(hsep_averaged *self, const hsep_predictor_parameters *parameters);
/* Fill the block, which is 0, at rest at start, m, with nothing learned. */
HSEP_API void hsep_averaged_init(hsep_averaged *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* Parts of the block; of the experts not hold. */
static inline hsep_disturbances *hsep_averaged_disturbances(hsep_averaged *self)
{
    return hsep_part(self, self->disturbances);
}
static inline hsep_command *hsep_averaged_command(hsep_averaged *self) { return hsep_part(self, self->command); }
static inline hsep_recall *hsep_averaged_recall(hsep_averaged *self) { return hsep_part(self, self->recall); }

/* Weight in the stack with which what is recalled moves as an expert answers to other commands. */
static inline hsep_real hsep_averaged_moves(hsep_averaged *self, hsep_int expert)
{
    return expert == HSEP_ARX_COMMAND ? hsep_averaged_recall(self)->moves * self->shares[HSEP_RECALL] : 0.0;
}

static inline hsep_warm_start *hsep_averaged_evidence(hsep_averaged *self, hsep_int kind)
{
    return hsep_part(self, self->evidence[kind]);
}
static inline hsep_expert *hsep_averaged_expert(hsep_averaged *self, hsep_int expert)
{
    return hsep_part(self, self->experts[expert]);
}

/* HSEP_COMMAND_RESIDUAL if an expert predicts the residual of the command, else HSEP_MODEL_RESIDUAL. */
static inline hsep_int hsep_averaged_kind_of(const hsep_averaged *self, hsep_int expert)
{
    return hsep_expert_of(hsep_expert_of(expert).is_fresh ? self->leading : expert).target;
}

/* Lags among the features of the rows of some evidence, which has them backwards before the other features. */
static inline hsep_int hsep_averaged_lags(const hsep_averaged *self, hsep_int kind)
{
    return kind == HSEP_COMMAND_RESIDUAL ? HSEP_AVERAGING_LAGS_OF_COMMAND : self->p;
}

/* Whether this run doubts earlier ones. */
static inline int hsep_averaged_doubts(hsep_averaged *self)
{
    return hsep_warm_start_earlier(hsep_averaged_evidence(self, HSEP_MODEL_RESIDUAL))->n_rows > 0.0;
}

/* The solution of an expert; NULL where no rows train it. */
HSEP_API hsep_solution *hsep_averaged_solution(hsep_averaged *self, hsep_int expert);

/* The same, which begins now if it has not yet. */
HSEP_API hsep_solution *hsep_averaged_begun(hsep_averaged *self, hsep_int expert);

/* Prepare the solutions, with variances of the noise as they are known now. scales: (HSEP_N_RESIDUALS,) of the
 * residuals so far; errors: (HSEP_N_REGRESSIONS,) of the regressions. */
HSEP_API void hsep_averaged_prepare_solutions(
    hsep_averaged *self, const hsep_residual_scale scales[], const hsep_expert_errors errors[]);

/* Begin a run with what an earlier one has learned, loaded into a fresh block: it is discounted and doubted, as a
 * machine may have changed meanwhile. */
HSEP_API void hsep_averaged_restart(hsep_averaged *self);

/* Predict the residual e, (n + p,), m, in the samples 0 ... last - 1 that come next; after it the last residuals,
 * as measured. x_d: commands, x_pb: physics-based prediction, (n,), m; path: unmodified commands of the last n_path
 * of them, m, of a compensator; or NULL. Cost: for each expert a hsep_solution_finish, last m^2 / 2 multiply-adds
 * with its m features and last n / 2; 6 n tanh. */
HSEP_API void hsep_averaged_forecast(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], const hsep_real path[], hsep_int n_path,
    hsep_real e[], hsep_int last);

/* Predict samples first ... last - 1, too, where the last call ended; stride: as hsep_expert_predict's. */
HSEP_API void hsep_averaged_go_on(
    hsep_averaged *self, const hsep_real x_pb[], hsep_real e[], hsep_int first, hsep_int last, hsep_int stride);

/* Predict samples 0 ... last - 1 of other commands with the same scales and weights; hsep_averaged_go_on does more. */
HSEP_API void hsep_averaged_predict(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_int last, hsep_int stride);

/* Weigh the experts as the stack of predictions does, as a forecast begins, or as that of plans; e, (n + p,), m: the
 * samples 0 ... last - 1 that were predicted are stacked anew. Cost: 36 last multiply-adds. */
HSEP_API void hsep_averaged_weigh(hsep_averaged *self, hsep_int stack, hsep_real e[], hsep_int last);

/* Keep what is stacked half a plan ahead for the window that it is measured in; is_known: whether it was predicted.
 * Cost: n_ahead HSEP_N_EXPERTS Np words are moved. */
HSEP_API void hsep_averaged_keep_ahead(hsep_averaged *self, int is_known);

/* Begin the run of that window, its first one, in motion: x_d and x_pb, (Np,), m, Np > 1, with the motion before it. */
HSEP_API void hsep_averaged_begin_in_motion(hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[]);

/* Follow that window as it is measured: judge and learn its samples up to last - 1, HSEP_AVERAGED_PACE of them in a
 * call. All of the window must have been predicted. x_d: its commands, (Np,), m; e: (Np + p,), m, becomes its
 * residuals; where a measurement is not believed, the predicted one, shifted as the believed ones beside it are off;
 * after it the earlier ones. A sample costs a hsep_gram_fold for each residual, and after solving_from samples a share
 * of the next window's solutions. */
HSEP_API void hsep_averaged_follow(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_int last);

/* Learn the rest of that window, and judge the experts by it. fold: whether it is learned, as it was followed if so;
 * the next window starts from it in any case. */
HSEP_API void hsep_averaged_learn(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], int fold);

#endif

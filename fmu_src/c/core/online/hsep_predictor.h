/* Hybrid predictor, sample by sample (hsep.h says what one brings); eqs. (2) to (6).
 *
 * When k + 1 is a multiple of Np, the next window and every measurement before it have arrived: the weights are solved
 * and the window is predicted in that sample. What is measured over the first fill (k < preview) is not learned. Where
 * measurements are late, the late samples before a window, which are not measured yet, are predicted with it: n = Np +
 * late samples. The first Np of these are learned when the window ends.
 *
 * hsep_predictor_sample, preview = Np, predicts under the commands as they came. A compensator, which decides
 * the commands of a window, calls the parts in this order: hsep_predictor_take_in at each sample; at the end of a
 * window hsep_predictor_finish and _begin; once commands are decided, hsep_predictor_predict, _publish, _predict_std.
 *
 * Cost of a sample, at any sample number: hsep_regression_fold and hsep_physics_respond; at the end of a window also
 * hsep_regression_solve and hsep_recursion_run. With averaging two hsep_gram_fold, before the end of a window a share
 * of the next solutions (hsep_solution.h), at its end hsep_averaged_learn and the first part of hsep_averaged_forecast,
 * whose other parts the next samples do. At the end of a first window whose commands begin in motion all its rows are
 * folded and the solutions factored at once.
 *
 * Once the parameters are in range nothing here fails but the prediction of a window: the learned recursion may
 * diverge; then divergence is set and the outputs are invalid from there on.
 */
#ifndef HSEP_PREDICTOR_H
#define HSEP_PREDICTOR_H

#include "hsep.h"
#include "hsep_averaged_model.h"
#include "hsep_paper.h"
#include "hsep_physics.h"
#include "hsep_settings.h"
#include "hsep_start.h"
#include "hsep_uncertainty.h"

struct hsep_predictor {
    hsep_int Np, late, n, preview; /* n = Np + late */
    hsep_int p, q;                 /* lags of e_pb and of x_pb */
    hsep_real n_init;
    hsep_real start;                /* position of rest, m */
    hsep_int k;                     /* index of the next sample */
    hsep_int n_published;           /* samples of the window that are predicted */
    hsep_int n_physics;             /* leading samples of the window where x_h = x_pb */
    hsep_int learning;              /* whether the window is learned */
    hsep_int n_measured;            /* samples since t_init */
    hsep_real sum_e, sum_pb, sum_h; /* m2, sums of squared servo and prediction errors over them */
    hsep_real sum_hold;             /* m2, the same if the last residual measured before each window were held */
    hsep_real residual;  /* m, of the last sample measured, as published; 0 before any after the first fill */
    hsep_real held;      /* m, that before the window */
    hsep_int early;      /* whether measurements come a sample early */
    hsep_real next;      /* m, then the measurement of the next sample; NaN if it is missing */
    hsep_int divergence; /* hsep_divergence of the first window that diverged; latched */
    hsep_int ahead;      /* (preview,) m, ring of the commands that came last */
    hsep_int x_d;        /* (horizon,) m, commands of the window and what follows it; a compensator extends them */
    hsep_int x_pb;       /* (Np,) m, the window: physics-based predictions, */
    hsep_int x_h;        /* (Np,) m, hybrid predictions, */
    hsep_int x_hold;     /* (Np,) m, and held added to x_pb; before all four the last samples not measured yet */
    hsep_int ahead_pb;   /* (Np,) m, response of the physics model to ahead, relative to start; without a compensator */
    hsep_int command;    /* (n,) m, commands of the window relative to start, newest first */
    hsep_int past_x;     /* (n + q,) m, x_pb of this window and of the q samples before it, newest first */
    hsep_int past_e;     /* (n + p,) m, e_pb likewise, as measured */
    hsep_int e_h;        /* (n + p,) m, e_pb as predicted, after it the measured ones; without a compensator past_e */
    hsep_int physics, uncertainty;
    hsep_int paper, averaged; /* the model of the residual e_pb = x - x_pb; the other one is 0 */
    hsep_int motion;          /* the motion before the run; with averaging and no compensator */
};
HSEP_ASSERT_WORDS(hsep_predictor, 37);

/* Parameters that follow from the library's; the modes are not copied. */
HSEP_API hsep_predictor_parameters hsep_predictor_derive(const hsep_parameters *parameters);
HSEP_API hsep_real hsep_predictor_lay_out(hsep_predictor *self, const hsep_predictor_parameters *parameters);
/* Fill the block for a drive at rest at start, m. */
HSEP_API void hsep_predictor_block_init(
    hsep_predictor *self, const hsep_predictor_parameters *parameters, hsep_real start);

/* Parts of the block: the physics model; the residual model, NULL if it is the other one; what errors of x_h follow. */
static inline hsep_physics *hsep_predictor_physics(hsep_predictor *self) { return hsep_part(self, self->physics); }
static inline hsep_paper *hsep_predictor_paper(hsep_predictor *self)
{
    return self->paper ? hsep_part(self, self->paper) : NULL;
}
static inline hsep_averaged *hsep_predictor_averaged(hsep_predictor *self)
{
    return self->averaged ? hsep_part(self, self->averaged) : NULL;
}
static inline hsep_uncertainty *hsep_predictor_uncertainty(hsep_predictor *self)
{
    return hsep_part(self, self->uncertainty);
}

/* Process sample k: learn it if it is sound, update the error sums, advance to k + 1; return whether a window ended. */
HSEP_API int hsep_predictor_take_in(hsep_predictor *self, hsep_real x_d_ahead, hsep_real x_meas, int is_sound);

/* Predict at once what is left of the window, without a compensator; later samples are the same. */
HSEP_API void hsep_predictor_complete(hsep_predictor *self);

/* Finish a window: learn it with averaging, and its errors; its residuals become the past of the next one. */
HSEP_API void hsep_predictor_finish(hsep_predictor *self);

/* Begin a window: commands and weights. */
HSEP_API void hsep_predictor_begin(hsep_predictor *self);

/* Predict the residuals e_h of samples first ... last - 1 of the n; first is 0, or where the last call ended. */
HSEP_API void hsep_predictor_predict(hsep_predictor *self, hsep_int first, hsep_int last);

/* Publish the samples of the window up to last - 1, whose x_pb are in past_x and residuals in e_h; eq. (4). */
HSEP_API void hsep_predictor_publish(hsep_predictor *self, hsep_int last);

/* Predict the errors of samples first ... last - 1 of the n, hsep_predictor_std, which were published. */
HSEP_API void hsep_predictor_predict_std(hsep_predictor *self, hsep_int first, hsep_int last);

/* Leading samples in the warm-up, of the window and the late ones before it. */
HSEP_API hsep_int hsep_predictor_warm_up(const hsep_predictor *self, hsep_int late);

#endif

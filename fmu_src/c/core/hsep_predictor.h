/* The predictor, sample by sample: the look-ahead buffer between the interpolator and the drive; eqs. (2) to (6).
 *
 * Sample k brings x_d_ahead = r(k) and x_meas = x(k); after it the outputs are those of k + 1, and the drive gets
 * x_d(k) = r(k - Np). When k + 1 is a multiple of Np, the whole next window and every measurement before it have
 * arrived: the weights are solved and the window is predicted in that sample. The first fill (k < Np) keeps the
 * drive at its start; it is neither learned nor used.
 *
 * Work is spread: the physics model answers a command, and a row of features is folded into the regression, in the
 * sample that brings them. Cost of a sample, with n = 2 + q + p: that of hsep_regression_fold(n); at the end of a
 * window (Np (p + q + 2) + n^2 / 2) multiply-adds on top. Never more, at no sample number.
 *
 * Memory is one block: the struct, then what its offsets tell; no pointers, so a copy of the block is the state.
 * Reentrant; allocates nothing; nothing here can fail once the parameters are in range.
 */
#ifndef HSEP_PREDICTOR_H
#define HSEP_PREDICTOR_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_physics.h"
#include "hsep_regression.h"

#include <stdint.h>

typedef struct {
    uint64_t Np;        /* samples in a window, >= 1 */
    uint64_t p;         /* lags of e_pb, 1 ... Np */
    uint64_t q;         /* lags of x_pb, 0 ... Np - 1 */
    uint64_t dead_time; /* samples */
    uint64_t n_modes;   /* >= 1 */
    double lambda;      /* m2, > 0 */
    double T_s;         /* s, > 0 */
    double n_init;      /* samples of warm-up after the first fill: x_h = x_pb; whole, >= 0 */
    hsep_hold hold;
    const hsep_mode *modes; /* (n_modes,) */
} hsep_predictor_parameters;

typedef struct {
    uint64_t Np, p, q;
    double n_init;
    double start;         /* position of rest, m */
    uint64_t k;           /* the sample that comes next */
    uint64_t n_warm_up;   /* leading samples of this window where x_h = x_pb */
    uint64_t n_measured;  /* samples since t_init */
    double sum_pb, sum_h; /* m2, sums of squared prediction errors over them */
    uint64_t divergence;  /* hsep_divergence of the first window that could not be predicted; stays */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t ahead;    /* (Np,) m, commands that came during this window */
    uint64_t ahead_pb; /* (Np,) m, what the physics model answers to them, relative to start */
    uint64_t x_d;      /* (Np,) m, the window: commands, */
    uint64_t x_pb;     /* (Np,) m, physics-based predictions, */
    uint64_t x_h;      /* (Np,) m, hybrid predictions */
    uint64_t past_x;   /* (Np + q,) m, x_pb of this window and of the q samples before it, newest first */
    uint64_t past_e;   /* (Np + p,) m, e_pb likewise; predicted ones where nothing is measured yet */
    uint64_t weights;  /* (2 + q + p,) w */
    uint64_t physics, regression;
} hsep_predictor;

HSEP_ASSERT_WORDS(hsep_predictor, 21);

typedef struct {
    double x_d, x_pb, x_h; /* m, now */
    double rms_pb, rms_h;  /* m, since t_init */
    uint64_t batch;        /* floor(k / Np) */
    int hybrid_active;     /* whether x_h is the hybrid prediction now */
} hsep_predictor_outputs;

/* Bytes of the block, counted in double so that no size can overflow. */
HSEP_API double hsep_predictor_size(const hsep_predictor_parameters *parameters);

/* Fill the block for a drive at rest at start, m. */
HSEP_API void hsep_predictor_init(hsep_predictor *self, const hsep_predictor_parameters *parameters, double start);

/* Tell whether a block of bytes, in any alignment and hsep_predictor_size(parameters) long, is one that
 * hsep_predictor_init with these parameters began: its layout is the same and every index lies within it. */
HSEP_API int hsep_predictor_valid(const void *block, const hsep_predictor_parameters *parameters);

/* Where the factor is, to start warm by hsep_regression_load before the first sample. */
HSEP_API hsep_regression *hsep_predictor_regression(hsep_predictor *self);

/* Take in sample k, both finite, m, and move on to k + 1; return whether a new window has begun. If it diverges, the
 * outputs are of no use from then on, and divergence says so. */
HSEP_API int hsep_predictor_sample(hsep_predictor *self, double x_d_ahead, double x_meas);

/* Tell the outputs of the sample that comes next. Constant cost. */
HSEP_API void hsep_predictor_read(const hsep_predictor *self, hsep_predictor_outputs *outputs);

/* The array at an offset of the struct, for example hsep_predictor_array(self, self->x_h). */
HSEP_API const double *hsep_predictor_array(const hsep_predictor *self, uint64_t offset);

#endif

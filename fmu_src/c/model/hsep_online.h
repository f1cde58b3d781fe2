/* What HybridPredictor and SepCompensator, the models with a look-ahead, do each in its own way; model_online.c does
 * the rest for both. One of them is compiled into an FMU, so the functions are bound when it is. */
#ifndef HSEP_ONLINE_H
#define HSEP_ONLINE_H

#include "hsep_api.h"
#include "hsep_fmu.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)

#include "hsep_predictor.h"

#define HSEP_ONLINE_KIND UINT64_C(0x4453524550594848) /* any number that no other model has */
typedef hsep_predictor hsep_online;
typedef struct {
    hsep_predictor_parameters predictor;
} hsep_online_parameters;

#elif defined(HSEP_MODEL_SEP_COMPENSATOR)

#include "hsep_compensator.h"

#define HSEP_ONLINE_KIND UINT64_C(0x4E45504D4F435053) /* any number that no other model has */
typedef hsep_compensator hsep_online;
typedef hsep_compensator_parameters hsep_online_parameters;

#endif

#if defined(HSEP_ONLINE_KIND)

/* Check what no other model has; return how many settings are wrong, each added to message. */
HSEP_API int hsep_online_check(const double values[], char message[]);

/* Read what no other model has, after all parameters were checked; the others are there already. */
HSEP_API void hsep_online_read(const double values[], hsep_online_parameters *parameters);

/* Bytes of the block, counted in double. */
HSEP_API double hsep_online_size(const hsep_online_parameters *parameters);

/* Fill the block for a drive at rest at start, m; begin the first window once what was learned is there. */
HSEP_API void hsep_online_init(hsep_online *self, const hsep_online_parameters *parameters, double start);
HSEP_API void hsep_online_begin(hsep_online *self);

HSEP_API hsep_predictor *hsep_online_predictor(hsep_online *self);

/* Tell whether a block, in any alignment, is one with these parameters at sample k. */
HSEP_API int hsep_online_valid(const void *block, const hsep_online_parameters *parameters, uint64_t k);

/* Take in a sample; return whether a new window has begun. */
HSEP_API int hsep_online_sample(hsep_online *self, double x_d_ahead, double x_meas);

/* Write outputs and locals; window: whether it is a new one. */
HSEP_API void hsep_online_write(const hsep_online *self, int window, double values[]);

#endif

#endif

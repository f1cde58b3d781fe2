/* Interface between model_online.c and HybridPredictor or SepCompensator, the models with a look-ahead. One of them is
 * compiled into an FMU, so the functions are bound at compile time. */
#ifndef HSEP_ONLINE_H
#define HSEP_ONLINE_H

#include "hsep.h"
#include "hsep_fmu.h"
#include "hsep_model.h"

#if defined(HSEP_MODEL_HYBRID_PREDICTOR)

#include "hsep_predictor.h"

#define HSEP_ONLINE(function) hsep_predictor_##function
typedef hsep_predictor hsep_online;
typedef hsep_predictor_parameters hsep_online_parameters;

#elif defined(HSEP_MODEL_SEP_COMPENSATOR)

#include "hsep_compensator.h"

#define HSEP_ONLINE(function) hsep_compensator_##function
typedef hsep_compensator hsep_online;
typedef hsep_compensator_parameters hsep_online_parameters; /* the predictor's are the first of them */

#endif

#if defined(HSEP_ONLINE)

/* Check the settings of this model alone; return how many settings are wrong, each added to message. */
HSEP_API int hsep_online_check(const double values[], char message[]);

/* Derive the parameters of this model, after all were checked and the common ones read; its own are read. */
HSEP_API hsep_online_parameters hsep_online_derive(const double values[], hsep_parameters *common);

/* Take the tunable parameters over from the next window on. */
HSEP_API void hsep_online_tune(hsep_online *self, const double values[]);

/* Begin, after learned weights were loaded. */
HSEP_API void hsep_online_begin(hsep_online *self);

HSEP_API hsep_predictor *hsep_online_predictor(hsep_online *self);

/* Write the outputs. */
HSEP_API void hsep_online_write(const hsep_online *self, double values[]);

#endif

#endif

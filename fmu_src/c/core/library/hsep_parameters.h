/* Parameters of the library: their ranges, and what predictor and compensator derive from them. Reentrant. */
#ifndef HSEP_PARAMETERS_H
#define HSEP_PARAMETERS_H

#include "hsep.h"
#include "hsep_compensator.h"
#include "hsep_predictor.h"

/* What the block is laid out by; the modes are not copied. */
HSEP_API hsep_predictor_parameters hsep_predictor_derive(const hsep_parameters *parameters);
HSEP_API hsep_compensator_parameters hsep_compensator_derive(const hsep_parameters *parameters);

/* Bytes of a block as an object's size; 0 if it cannot be one. */
HSEP_API size_t hsep_block_bytes(hsep_real bytes);

#endif

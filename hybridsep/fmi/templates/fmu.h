/* The interface of $whose: generated from the table that modelDescription.xml comes from. */
#ifndef HSEP_FMU_H
#define HSEP_FMU_H

#include <math.h>

#include "hsep_model.h"

#define HSEP_MODEL_${model} 1
#define HSEP_INTERFACE UINT64_C(0x${number}) /* of all below, up to the table of one FMU */
$interface
$table
#endif

/* Axis of hybridsep $version: $name, its $kind, for hsep.h.
 *
 *     hsep_parameters parameters;
 *     ${name}_parameters(&parameters);
 *     hsep_${kind}_init(block, &parameters, start, ${name}_weights, ${name}_weights_size);
 */
#ifndef HSEP_AXIS_${name}_H
#define HSEP_AXIS_${name}_H

#include "hsep.h"

/* f_n, Hz; zeta; alpha, 1/s^2; beta, 1/s */
static const hsep_mode ${name}_modes[] = {
$modes
};

$weights

/* Fill in its settings and modes. */
static inline void ${name}_parameters(hsep_parameters *parameters)
{
    hsep_defaults(parameters);
$settings
    parameters->n_modes = $n_modes;
    parameters->modes = ${name}_modes;
}

#endif

/* The library's predictor: its size and beginning from the settings; the rest is hsep_predictor.c's, and
 * hsep_learned.c's. */
#include "hsep_learned.h"

HSEP_API size_t hsep_predictor_size(const hsep_parameters *parameters)
{
    if (hsep_predictor_refused(parameters) != NULL) {
        return 0;
    }
    const hsep_predictor_parameters derived = hsep_predictor_derive(parameters);
    return hsep_block_bytes(hsep_predictor_lay_out(&(hsep_predictor){0}, &derived));
}

HSEP_API hsep_began hsep_predictor_init(
    hsep_predictor *self, const hsep_parameters *parameters, hsep_real start, const void *weights, size_t weights_size)
{
    const hsep_predictor_parameters derived = hsep_predictor_derive(parameters);
    hsep_predictor_block_init(self, &derived, start);
    const hsep_began began = hsep_learned_load(self, parameters, weights, weights_size);
    if (began != HSEP_BEGAN) {
        hsep_predictor_block_init(self, &derived, start);
    }
    return began;
}

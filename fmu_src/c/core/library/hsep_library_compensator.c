/* The library's compensator: its size and beginning from the settings; its predictor has the weights. */
#include "hsep_compensator.h"
#include "hsep_learned.h"

HSEP_API size_t hsep_compensator_size(const hsep_parameters *parameters)
{
    if (hsep_compensator_refused(parameters) != NULL) {
        return 0;
    }
    const hsep_predictor_parameters derived = hsep_compensator_derive(parameters);
    return hsep_block_bytes(hsep_compensator_lay_out(&(hsep_compensator){0}, &derived));
}

HSEP_API hsep_began hsep_compensator_init(
    hsep_compensator *self, const hsep_parameters *parameters, hsep_real start, const void *weights,
    size_t weights_size)
{
    const hsep_predictor_parameters derived = hsep_compensator_derive(parameters);
    hsep_compensator_block_init(self, &derived, start);
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_began began = hsep_learned_load(predictor, parameters, weights, weights_size);
    if (began != HSEP_BEGAN) {
        hsep_compensator_block_init(self, &derived, start);
    }
    hsep_compensator_begin(self);
    return began;
}

HSEP_API size_t
hsep_compensator_weights(hsep_compensator *self, const hsep_parameters *parameters, void *bytes, size_t size)
{
    return hsep_predictor_weights(hsep_compensator_predictor(self), parameters, bytes, size);
}

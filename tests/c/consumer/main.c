/* Predict nine windows of a drive that follows its command; print the batch and whether x_pb has settled. */
#include "hsep.h"

#include <stdio.h>
#include <stdlib.h>

int main(void)
{
    const double omega = 157.0;
    hsep_mode mode = {25.0, 0.3, 0.0, 0.0};
    hsep_parameters parameters;
    hsep_predictor_outputs outputs;
    int sample = 0;
    mode.alpha = omega * omega;
    hsep_defaults(&parameters);
    parameters.predictor.p = 5;
    parameters.n_modes = 1;
    parameters.modes = &mode;
    hsep_predictor *predictor = (hsep_predictor *)malloc(hsep_predictor_size(&parameters)); /* cast for C++ */
    if (predictor == NULL || hsep_predictor_init(predictor, &parameters, 0.0, NULL, 0) != HSEP_BEGAN) {
        return 1;
    }
    for (; sample < 900; sample++) {
        (void)hsep_predictor_sample(predictor, 1e-3, 1e-3);
    }
    hsep_predictor_read(predictor, &outputs);
    printf("%d %d\n", (int)outputs.batch, outputs.x_pb > 0.99e-3 && outputs.x_pb < 1.01e-3);
    free(predictor);
    return outputs.divergence == HSEP_CONVERGES ? 0 : 1;
}

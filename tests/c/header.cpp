/* Predict two windows of a drive that follows its command through hsep.h in C++; print the batch and whether the
 * physics model has settled. */
#include "hsep.h"

#include <cstdio>
#include <vector>

int main()
{
    const hsep_mode mode = {25.0, 0.05, 24674.0, 15.7};
    hsep_predictor_parameters parameters = {};
    parameters.settings.Np = parameters.preview = 100;
    parameters.settings.p = 5;
    parameters.settings.q = 2;
    parameters.n_modes = 1;
    parameters.settings.lambda = 1e-8;
    parameters.settings.T_s = 1e-3;
    parameters.modes = &mode;
    std::vector<double> block(static_cast<size_t>(hsep_predictor_size(&parameters)) / sizeof(double));
    hsep_predictor *predictor = reinterpret_cast<hsep_predictor *>(block.data());
    hsep_predictor_init(predictor, &parameters, 0.0);
    for (int k = 0; k < 900; k++) {
        (void)hsep_predictor_sample(predictor, 1e-3, 1e-3);
    }
    hsep_predictor_outputs outputs;
    hsep_predictor_read(predictor, &outputs);
    const int settled = outputs.x_pb > 0.99e-3 && outputs.x_pb < 1.01e-3;
    std::printf("%d %d\n", static_cast<int>(outputs.batch), settled);
    return predictor->divergence == HSEP_CONVERGES ? 0 : 1;
}

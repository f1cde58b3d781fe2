// The same in C++11, by a compensator in a block of the standard library.
#include "hsep.h"

#include <cstdio>
#include <vector>

int main()
{
    const double omega = 157.0;
    hsep_mode mode = {25.0, 0.3, 0.0, 0.0};
    hsep_parameters parameters;
    hsep_compensator_outputs outputs;
    int sample = 0;
    mode.alpha = omega * omega;
    hsep_defaults(&parameters);
    parameters.predictor.p = 5;
    parameters.n_modes = 1;
    parameters.modes = &mode;
    std::vector<double> block(hsep_compensator_size(&parameters) / sizeof(double));
    hsep_compensator *compensator = reinterpret_cast<hsep_compensator *>(block.data());
    if (block.empty() || hsep_compensator_init(compensator, &parameters, 0.0, nullptr, 0) != HSEP_BEGAN) {
        return 1;
    }
    for (; sample < 900; sample++) {
        (void)hsep_compensator_sample(compensator, 1e-3, 1e-3);
    }
    hsep_compensator_read(compensator, &outputs);
    const double x_pb = outputs.predicted.x_pb;
    std::printf("%d %d\n", static_cast<int>(outputs.predicted.batch), x_pb > 0.99e-3 && x_pb < 1.01e-3);
    return outputs.predicted.divergence == HSEP_CONVERGES ? 0 : 1;
}

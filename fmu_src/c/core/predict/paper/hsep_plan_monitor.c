#include "hsep_plan_monitor.h"

static const double monitor_forget = 0.9;      /* forgetting factor per window: a memory of about ten */
static const double monitor_noise_share = 0.5; /* tolerance, of the noise variance: at rest noise alone would decide */
static const double monitor_worst = 2.0; /* bound on one window's mean square error, relative to physics and noise */

HSEP_API void hsep_plan_monitor_observe(
    hsep_plan_monitor *self, const double e_pb[], const double e_h[], uint64_t n, double noise_variance)
{
    double physics = 0.0, hybrid = 0.0;
    for (uint64_t i = 0; i < n; i++) {
        physics += e_pb[i] * e_pb[i];
        hybrid += (e_pb[i] - e_h[i]) * (e_pb[i] - e_h[i]);
    }
    physics /= (double)n;
    hybrid /= (double)n;
    if (!(hybrid <= monitor_worst * (physics + noise_variance))) { /* NaN too */
        hybrid = monitor_worst * (physics + noise_variance);
    }
    const double worse = hybrid - physics - monitor_noise_share * noise_variance;
    self->excess = monitor_forget * self->excess + (1.0 - monitor_forget) * worse;
}

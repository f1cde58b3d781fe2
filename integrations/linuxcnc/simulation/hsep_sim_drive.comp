component hsep_sim_drive "Simulated drive behind its encoder: second order, friction, noise";
description """A closed position loop of natural frequency fn and damping ratio zeta. Friction acts as a deviation of its
command; the encoder has a resolution and noise that is the same in every run.""";
pin in float cmd "commanded position, machine units";
pin out float fb "measured position, machine units";
pin out float pos "true position, machine units";
pin out s32 overruns "periods that began half a period late or more";
param rw float fn = 25.0 "natural frequency, Hz";
param rw float zeta = 0.3 "damping ratio";
param rw float friction = 0.02 "friction, as a deviation of the command, machine units";
param rw float resolution = 0.0005 "of the encoder, machine units";
param rw float noise = 0.001 "standard deviation, machine units";
variable double x;
variable double v;
variable unsigned seed = 1;
variable int begun;
variable rtapi_s64 at;
function read fp "what is measured at the begin of a period: before what uses it";
function write fp "motion under the command: after what commands it";
license "BSD";
author "the authors of hybridsep";
;;
#include <rtapi_math.h>

#define SUBSTEPS 20

/* Sum of 12 uniform numbers of a linear congruential generator (Numerical Recipes' constants), less 6. */
static double drive_noise(unsigned *state)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++) {
        *state = *state * 1664525u + 1013904223u;
        sum += *state / 4294967296.0;
    }
    return sum;
}

FUNCTION(read)
{
    const rtapi_s64 now = rtapi_get_time(); /* ns */
    if (!begun) {
        x = cmd;
        begun = 1;
    } else if (now - at > period + period / 2) {
        overruns += 1;
    }
    at = now;
    pos = x;
    fb = resolution * floor((x + noise * drive_noise(&seed)) / resolution + 0.5);
}

FUNCTION(write)
{
    const double w = 2.0 * 3.14159265358979323846 * fn, h = 1e-9 * (double)period / SUBSTEPS;
    for (int i = 0; i < SUBSTEPS; i++) { /* semi-implicit Euler */
        const double deviation = friction * tanh(v / 0.05);
        v += h * (w * w * (cmd - x - deviation) - 2.0 * zeta * w * v);
        x += h * v;
    }
}

/* A loop of 1 kHz on Linux that compensates a simulated drive, with locked memory; at its end a histogram.
 *
 *     realtime [SECONDS]
 *
 * The time of a step is the time of hsep_compensator_sample and _read together. With the right to do so (root, or
 * CAP_SYS_NICE and CAP_IPC_LOCK) it runs as SCHED_FIFO; on a kernel without PREEMPT_RT how late a period begins says
 * little.
 */
#define _GNU_SOURCE

#include "hsep.h"

#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

#define PERIOD 1000000L /* ns */
#define PRIORITY 80
#define BINS 24 /* bin i: 2^i ns and more */

static const double pi = 3.14159265358979323846;

/* Times so far. */
typedef struct {
    unsigned long count[BINS];
    double sum;
    long dearest; /* ns */
} histogram;

static void count(histogram *self, long ns)
{
    int bin = 0;
    while (bin + 1 < BINS && (2L << bin) <= ns) {
        bin++;
    }
    self->count[bin]++;
    self->sum += (double)ns;
    self->dearest = ns > self->dearest ? ns : self->dearest;
}

static void print(const histogram *self, const char *title, unsigned long n)
{
    printf("%s: mean %.1f us, dearest %.1f us\n", title, 1e-3 * self->sum / (double)n, 1e-3 * (double)self->dearest);
    for (int bin = 0; bin < BINS; bin++) {
        if (self->count[bin] > 0) {
            printf("  from %9.3f us  %8lu\n", 1e-3 * (double)(1L << bin), self->count[bin]);
        }
    }
}

static long nanoseconds(struct timespec from, struct timespec to)
{
    return 1000000000L * (long)(to.tv_sec - from.tv_sec) + (long)(to.tv_nsec - from.tv_nsec);
}

/* A drive: a second-order lag of 25 Hz with friction, by semi-implicit Euler steps of 0.1 ms. */
typedef struct {
    double x, v; /* m, m/s */
} drive;

static void move(drive *self, double command)
{
    const double omega = 2.0 * pi * 25.0, zeta = 0.3, friction = 0.5; /* m/s2 */
    for (int i = 0; i < 10; i++) {
        const double a =
            omega * omega * (command - self->x) - 2.0 * zeta * omega * self->v - friction * tanh(1e3 * self->v);
        self->v += 1e-4 * a;
        self->x += 1e-4 * self->v;
    }
}

/* Command of sample k, m: 20 mm to and fro within two seconds. */
static double command(unsigned long k) { return 1e-2 * (1.0 - cos(pi * 1e-3 * (double)k)); }

int main(int argc, char *argv[])
{
    const unsigned long n = (unsigned long)(1000.0 * (argc > 1 ? atof(argv[1]) : 10.0));
    const double omega = 2.0 * pi * 25.0;
    const hsep_mode mode = {.f_n = 25.0, .zeta = 0.3, .alpha = omega * omega};
    hsep_parameters parameters;
    hsep_defaults(&parameters);
    parameters.n_modes = 1;
    parameters.modes = &mode;
    const size_t size = hsep_compensator_size(&parameters);
    hsep_compensator *compensator = size > 0 ? malloc(size) : NULL;
    if (compensator == NULL) {
        const char *refused = hsep_compensator_refused(&parameters);
        fprintf(stderr, "no compensator: %s\n", refused == NULL ? "no memory" : refused);
        return 1;
    }
    (void)hsep_compensator_init(compensator, &parameters, 0.0, NULL, 0);
    const struct sched_param priority = {.sched_priority = PRIORITY};
    printf(
        "a block of %lu bytes; memory %s, scheduling %s\n", (unsigned long)size,
        mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? "locked" : "not locked",
        sched_setscheduler(0, SCHED_FIFO, &priority) == 0 ? "SCHED_FIFO" : "as it was");
    histogram steps = {{0}, 0.0, 0}, latenesses = {{0}, 0.0, 0};
    drive axis = {0.0, 0.0};
    double squares = 0.0;
    struct timespec due, begun, ended;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (unsigned long k = 0; k < n; k++) {
        hsep_compensator_outputs outputs;
        due.tv_nsec += PERIOD;
        if (due.tv_nsec >= 1000000000L) {
            due.tv_nsec -= 1000000000L;
            due.tv_sec++;
        }
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        clock_gettime(CLOCK_MONOTONIC, &begun);
        (void)hsep_compensator_sample(compensator, command(k), axis.x);
        hsep_compensator_read(compensator, &outputs);
        clock_gettime(CLOCK_MONOTONIC, &ended);
        count(&latenesses, nanoseconds(due, begun));
        count(&steps, nanoseconds(begun, ended));
        squares += (outputs.predicted.x_d - axis.x) * (outputs.predicted.x_d - axis.x);
        move(&axis, outputs.x_dm);
    }
    print(&steps, "step", n);
    print(&latenesses, "late by", n);
    printf("rms of the servo error: %.2f um over %lu samples\n", 1e6 * sqrt(squares / (double)n), n);
    free(compensator);
    return 0;
}

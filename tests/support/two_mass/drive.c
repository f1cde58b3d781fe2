/* Two masses joined by a belt or a screw in a cascaded position loop, exact for its linear part.
 *
 * Over an internal step the linear loop advances by its exponential; what is nonlinear (friction, backlash, cogging,
 * the motor's limit) enters as a force that is held over the step. Positions, m, and forces, N per kg of the drive,
 * are relative to the rest that a run starts from.
 */
#include <math.h>
#include <string.h>

#define N 6             /* states: positions and velocities of motor and load, integral, motor force */
#define INPUTS 5        /* command, its slope, forces against motor and load, motor force beyond its limit */
#define DEAD_TIME_MAX 4 /* samples */

enum { X_MOTOR, V_MOTOR, X_LOAD, V_LOAD, INTEGRAL, FORCE };
enum { COMMAND, SLOPE, ON_MOTOR, ON_LOAD, BEYOND };

typedef struct {
    double A[N][N], B[N][INPUTS];
    double demand[N + 2]; /* motor force demanded, by states, command and slope */
    double stiffness, damping;
} linear_loop;

typedef struct {
    double coulomb, stribeck, v_stribeck, bristle, micro_damping;
} lugre;

/* Mirrored by plant.py, number by number. */
typedef struct {
    linear_loop loop[2]; /* before and after the change */
    lugre friction[2];   /* of motor and load */
    double change_at, dead_time, sub_steps, h;
    double interpolates, at_load;
    double half_play, force_max;
    double cogging, cogging_wave, cogging_phase;
    double lead, lead_wave, lead_phase;
    double x[N], deflection[2], line[DEAD_TIME_MAX], before, k;
} two_mass;

/* LuGre: z' = v - bristle |v| z / g(v), F = bristle z + micro_damping(v) z', implicit in z. */
static double friction_force(const lugre *self, double v, double h, double *deflection)
{
    if (self->coulomb == 0.0) {
        return 0.0;
    }
    const double ratio = v / self->v_stribeck, near_rest = 1.0 / (1.0 + ratio * ratio);
    const double level = self->coulomb * (1.0 + (self->stribeck - 1.0) * near_rest);
    const double before = *deflection;
    *deflection = (before + h * v) / (1.0 + h * self->bristle * fabs(v) / level);
    return self->bristle * *deflection + self->micro_damping * near_rest * (*deflection - before) / h;
}

/* Spring force that backlash takes away from a joint that is twisted by dx. */
static double slack(const linear_loop *loop, double half_play, double dx, double dv)
{
    if (fabs(dx) < half_play) {
        return loop->stiffness * dx + loop->damping * dv;
    }
    return loop->stiffness * copysign(half_play, dx);
}

static void advance(two_mass *self, const linear_loop *loop, double command, double slope)
{
    double *x = self->x, input[INPUTS] = {command, slope}, next[N];
    const double h = self->h;
    input[ON_MOTOR] = friction_force(&self->friction[0], x[V_MOTOR], h, &self->deflection[0]);
    input[ON_LOAD] = friction_force(&self->friction[1], x[V_LOAD], h, &self->deflection[1]);
    if (self->cogging != 0.0) {
        const double phase = self->cogging_phase;
        input[ON_MOTOR] += self->cogging * (sin(self->cogging_wave * x[X_MOTOR] + phase) - sin(phase));
    }
    if (self->half_play > 0.0) {
        const double taken = slack(loop, self->half_play, x[X_MOTOR] - x[X_LOAD], x[V_MOTOR] - x[V_LOAD]);
        input[ON_MOTOR] -= taken;
        input[ON_LOAD] += taken;
    }
    double demand = loop->demand[N] * command + loop->demand[N + 1] * slope;
    for (int i = 0; i < N; i++) {
        demand += loop->demand[i] * x[i];
    }
    if (fabs(demand) > self->force_max) {
        input[BEYOND] = demand - copysign(self->force_max, demand);
    }
    for (int i = 0; i < N; i++) {
        next[i] = 0.0;
        for (int j = 0; j < N; j++) {
            next[i] += loop->A[i][j] * x[j];
        }
        for (int j = 0; j < INPUTS; j++) {
            next[i] += loop->B[i][j] * input[j];
        }
    }
    memcpy(x, next, sizeof next);
}

/* Position where the encoder is, with the error of the lead there. */
double two_mass_position(const two_mass *self)
{
    const double x = self->x[self->at_load != 0.0 ? X_LOAD : X_MOTOR];
    return x + self->lead * (sin(self->lead_wave * x + self->lead_phase) - sin(self->lead_phase));
}

/* Advance by a sampling interval with the command x_d. */
void two_mass_step(two_mass *self, double x_d)
{
    const int late = (int)self->dead_time, n = (int)self->sub_steps;
    const double command = late > 0 ? self->line[late - 1] : x_d;
    memmove(self->line + 1, self->line, (DEAD_TIME_MAX - 1) * sizeof self->line[0]);
    self->line[0] = x_d;
    const linear_loop *loop = &self->loop[self->k >= self->change_at];
    const double slope = (command - self->before) / (n * self->h);
    for (int j = 0; j < n; j++) {
        const double between = self->before + slope * (j + 0.5) * self->h;
        advance(self, loop, self->interpolates != 0.0 ? between : command, slope);
    }
    self->before = command;
    self->k += 1.0;
}

/* Run over n commands; x(k) is the position before x_d(k) acts. */
void two_mass_run(two_mass *self, int n, const double x_d[], double x[])
{
    for (int k = 0; k < n; k++) {
        x[k] = two_mass_position(self);
        two_mass_step(self, x_d[k]);
    }
}

#include "hsep_physics.h"

#define PHYSICS_TERMS 20 /* of the series: 0.5^20 / 20! < 1e-24 */

/* E := F G + scale E, all (4, 4) by rows; E is none of the others. */
static void physics_multiply(hsep_real E[16], const hsep_real F[16], const hsep_real G[16], hsep_real scale)
{
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            hsep_real sum = scale * E[4 * i + j];
            for (int k = 0; k < 4; k++) {
                sum += F[4 * i + k] * G[4 * k + j];
            }
            E[4 * i + j] = sum;
        }
    }
}

/* E := exp(M) - I, both (4, 4) by rows; M is halved on the way until its norm is at most 1/2.
 * Scaling and squaring (Moler and Van Loan 2003, method 3) of exp - I instead of exp: entries much smaller than 1
 * keep their relative accuracy, and many squarings do not wear the digits off. */
static void physics_expm1(hsep_real E[16], hsep_real M[16])
{
    hsep_real norm = 0.0;
    for (int i = 0; i < 16; i += 4) {
        norm = hsep_fmax(norm, hsep_fabs(M[i]) + hsep_fabs(M[i + 1]) + hsep_fabs(M[i + 2]) + hsep_fabs(M[i + 3]));
    }
    int exponent = 0;
    (void)hsep_frexp(norm, &exponent); /* norm < 2^exponent */
    const int squarings = exponent + 1 > 0 ? exponent + 1 : 0;
    for (int i = 0; i < 16; i++) {
        M[i] = hsep_ldexp(M[i], -squarings);
    }
    /* exp(M) - I = M (I + M/2 (I + M/3 (I + ...))), from the inside out */
    hsep_real P[16], Q[16];
    memset(P, 0, sizeof P);
    for (int term = PHYSICS_TERMS; term >= 1; term--) {
        memcpy(Q, M, sizeof Q);
        physics_multiply(Q, M, P, 1.0); /* Q = M + M P */
        for (int i = 0; i < 16; i++) {
            P[i] = Q[i] / (hsep_real)term;
        }
    }
    memcpy(E, P, 16 * sizeof *E);
    for (int i = 0; i < squarings; i++) {
        memcpy(P, E, sizeof P);
        physics_multiply(E, P, P, 2.0); /* (I + P)^2 - I = 2 P + P P */
    }
}

HSEP_API void hsep_discretise(hsep_discrete_mode *mode, const hsep_mode *continuous, hsep_real T_s, hsep_hold hold)
{
    const hsep_real omega = HSEP_TWO_PI * continuous->f_n; /* rad/s */
    /* States (omega^2 z, omega z') with z'' + 2 zeta omega z' + omega^2 z = u, both in m; then u and its ramp
     * (Van Loan 1978): the exponential of the augmented matrix holds Phi, Gamma_1 and Gamma_2. */
    hsep_real M[16] = {0.0}, E[16];
    M[1] = omega * T_s;
    M[4] = -omega * T_s;
    M[5] = -2.0 * continuous->zeta * omega * T_s;
    M[6] = omega * T_s;
    M[11] = 1.0; /* the ramp from u(k) to u(k+1) */
    physics_expm1(E, M);
    mode->A[0] = 1.0 + E[0];
    mode->A[1] = E[1];
    mode->A[2] = E[4];
    mode->A[3] = 1.0 + E[5];
    mode->c[0] = continuous->alpha / (omega * omega);
    mode->c[1] = continuous->beta / omega;
    const hsep_real gamma_1[2] = {E[2], E[6]}, gamma_2[2] = {E[3], E[7]};
    if (hold == HSEP_ZERO_ORDER_HOLD) {
        mode->b[0] = gamma_1[0];
        mode->b[1] = gamma_1[1];
        mode->d = 0.0;
    } else {
        /* xi(k+1) = Phi xi + Gamma_1 u(k) + Gamma_2 (u(k+1) - u(k)); s = xi - Gamma_2 u needs no future command:
         * b = Phi Gamma_2 + Gamma_1 - Gamma_2 */
        mode->b[0] = E[0] * gamma_2[0] + E[1] * gamma_2[1] + gamma_1[0];
        mode->b[1] = E[4] * gamma_2[0] + E[5] * gamma_2[1] + gamma_1[1];
        mode->d = mode->c[0] * gamma_2[0] + mode->c[1] * gamma_2[1];
    }
    mode->s[0] = mode->s[1] = 0.0;
}

HSEP_API hsep_real hsep_physics_lay_out(hsep_physics *self, const hsep_predictor_parameters *parameters)
{
    hsep_real end = HSEP_WORDS(hsep_physics);
    self->n_modes = parameters->n_modes;
    self->dead_time = parameters->settings.dead_time;
    self->modes = hsep_take(&end, (hsep_real)self->n_modes * HSEP_WORDS(hsep_discrete_mode));
    self->ring = hsep_take(&end, (hsep_real)self->dead_time);
    return end * sizeof(hsep_real);
}

static hsep_discrete_mode *physics_modes(hsep_physics *self) { return hsep_part(self, self->modes); }

HSEP_API void hsep_physics_init(hsep_physics *self, const hsep_predictor_parameters *parameters)
{
    const hsep_predictor_settings *settings = &parameters->settings;
    memset(self, 0, (size_t)hsep_physics_lay_out(self, parameters));
    (void)hsep_physics_lay_out(self, parameters);
    for (hsep_int i = 0; i < self->n_modes; i++) {
        hsep_discretise(&physics_modes(self)[i], &parameters->modes[i], settings->T_s, (hsep_hold)settings->input_hold);
    }
}

HSEP_API void hsep_physics_begin(hsep_physics *self, const hsep_real state[])
{
    self->oldest = 0;
    for (hsep_int i = 0; i < 2 * self->n_modes; i++) {
        physics_modes(self)[i / 2].s[i % 2] = state[i];
    }
    hsep_copy(hsep_at(self, self->ring), state + 2 * self->n_modes, self->dead_time);
}

HSEP_API void hsep_physics_add(hsep_physics *self, const hsep_physics *other)
{
    const hsep_discrete_mode *modes = hsep_part_const(other, other->modes);
    const hsep_real *ring = hsep_at_const(other, other->ring);
    for (hsep_int i = 0; i < self->n_modes; i++) {
        physics_modes(self)[i].s[0] += modes[i].s[0];
        physics_modes(self)[i].s[1] += modes[i].s[1];
    }
    for (hsep_int i = 0; i < self->dead_time; i++) {
        hsep_at(self, self->ring)[(self->oldest + i) % self->dead_time] += ring[(other->oldest + i) % self->dead_time];
    }
}

/* The command that leaves the dead time as another one enters it. */
static hsep_real physics_delay(hsep_physics *self, hsep_real u)
{
    hsep_real *oldest = hsep_at(self, self->ring) + self->oldest;
    const hsep_real delayed = *oldest;
    *oldest = u;
    self->oldest = self->oldest + 1 == self->dead_time ? 0 : self->oldest + 1;
    return delayed;
}

HSEP_API hsep_real hsep_physics_respond(hsep_physics *self, hsep_real x_d)
{
    const hsep_real u = self->dead_time > 0 ? physics_delay(self, x_d) : x_d;
    hsep_real x_pb = 0.0;
    for (hsep_int i = 0; i < self->n_modes; i++) {
        hsep_discrete_mode *m = &physics_modes(self)[i];
        const hsep_real s0 = m->s[0], s1 = m->s[1];
        /* x_pb = c s + d u,  s := A s + b u */
        x_pb += m->c[0] * s0 + m->c[1] * s1 + m->d * u;
        m->s[0] = m->A[0] * s0 + m->A[1] * s1 + m->b[0] * u;
        m->s[1] = m->A[2] * s0 + m->A[3] * s1 + m->b[1] * u;
    }
    return x_pb;
}

/* Add the responses of one mode of count models to n samples of the signals u, their states in registers: a function
 * of its own, as compilers believe restrict only of parameters. */
static void physics_respond_abreast(
    hsep_physics *const models[], size_t count, hsep_int mode, const hsep_real *restrict u, hsep_real *restrict x,
    size_t n)
{
    const hsep_discrete_mode *m = &physics_modes(models[0])[mode];
    const hsep_real a00 = m->A[0], a01 = m->A[1], a10 = m->A[2], a11 = m->A[3], b0 = m->b[0], b1 = m->b[1];
    const hsep_real c0 = m->c[0], c1 = m->c[1], d = m->d;
    hsep_real states[2][HSEP_PHYSICS_ABREAST] = {{0.0}};
    for (size_t i = 0; i < count; i++) {
        states[0][i] = physics_modes(models[i])[mode].s[0];
        states[1][i] = physics_modes(models[i])[mode].s[1];
    }
    for (size_t l = 0; l < HSEP_OF_FOUR; l++) {
        hsep_lanes *first = hsep_lanes_at(states[0]) + l, *second = hsep_lanes_at(states[1]) + l;
        hsep_lanes s0 = *first, s1 = *second, *to = hsep_lanes_at(x) + l;
        const hsep_lanes *from = hsep_lanes_const(u) + l;
        for (size_t k = 0; k < n; k++, from += HSEP_OF_FOUR, to += HSEP_OF_FOUR) {
            const hsep_lanes next = a00 * s0 + a01 * s1 + b0 * *from;
            *to += c0 * s0 + c1 * s1 + d * *from;
            s1 = a10 * s0 + a11 * s1 + b1 * *from;
            s0 = next;
        }
        *first = s0;
        *second = s1;
    }
    for (size_t i = 0; i < count; i++) {
        physics_modes(models[i])[mode].s[0] = states[0][i];
        physics_modes(models[i])[mode].s[1] = states[1][i];
    }
}

HSEP_API void hsep_physics_abreast(hsep_physics *const models[], size_t count, hsep_real u[], hsep_real x[], size_t n)
{
    for (size_t i = 0; i < count && models[i]->dead_time > 0; i++) {
        for (size_t k = 0; k < n; k++) {
            hsep_real *command = u + HSEP_PHYSICS_ABREAST * k + i;
            *command = physics_delay(models[i], *command);
        }
    }
    memset(x, 0, HSEP_PHYSICS_ABREAST * n * sizeof(hsep_real));
    for (hsep_int mode = 0; mode < models[0]->n_modes; mode++) {
        physics_respond_abreast(models, count, mode, u, x, n);
    }
}

/* Linearisation of the residual model with averaging (online model averaging) in the commands, over a plan's horizon.
 *
 * Disturbances are not affine in the commands, so a plan uses their slope at given commands, which is sech^2(v / v_i)
 * for friction, and 2 |x| for stiffness. Stop operators, the weights of the experts and of the stack, and the shrinking
 * by the variance, are held constant:
 *
 *   dx_h = (1 - pi_c - pi_r) G_pb + sum_i pi_i df_i + (pi_c + pi_r) dx_c
 *
 * c is arx_command, linear and time-invariant: its features are increments and lags of the command. i are arx_residual
 * and static; fresh_start counts as the expert whose counterpart it is; r is what recall moves by c's answer.
 */
#ifndef HSEP_LINEARISED_H
#define HSEP_LINEARISED_H

#include "hsep_averaged_model.h"
#include "hsep_plan_constants.h"

typedef struct {
    hsep_int n;       /* samples of a prediction, */
    hsep_int horizon; /* and its last ones, which a change may reach: all but what is late */
    hsep_int count;   /* disturbances */
    hsep_int moves;   /* samples in which v_d of a change, or of the sample before, is not 0 */
    /* Oldest first; of experts: of all that rows train, one after the other; abreast: HSEP_PHYSICS_ABREAST columns side
     * by side, sample after sample */
    hsep_int slopes;      /* (n, count) slopes of the disturbances, sample after sample */
    hsep_int gains;       /* (5, n) of experts: gains of disturbances and their differences, from v_d now and a sample
                           * before, from x now and in the two samples before */
    hsep_int shrink;      /* (n,) of experts: share of each one in the stack */
    hsep_int commands;    /* (1 + horizon,) of a change, with one sample before it, */
    hsep_int velocity;    /* (2 + horizon,) v_d of a change, with two samples before it, */
    hsep_int position;    /* (2 + horizon,) and it after G_pb */
    hsep_int base;        /* (horizon,) of a change: (1 - pi_A) G_pb + pi_A after the dead time, */
    hsep_int response;    /* (horizon + 3,) of experts: the response to it, of x_pb's features or of the command */
    hsep_int run;         /* (horizon + 3,) abreast: work of a recursion; one: newest first */
    hsep_int lags;        /* (p + 3,) weights of the lags, as often as a vector has lanes */
    hsep_int disturbance; /* (horizon + 3,) abreast: disturbances that a change makes, */
    hsep_int drive;       /* and these after G_pb */
    hsep_int physics;     /* G_pb at rest, */
    hsep_int filters;     /* and of each column */
} hsep_linearised;
HSEP_ASSERT_WORDS(hsep_linearised, 18);

#define LINEARISED_GAINS 5    /* of an expert: of v_d now and before, of x now and the two samples before */
#define LINEARISED_BEFORE 2   /* samples at rest before a change */
#define LINEARISED_TOGETHER 4 /* samples of a recursion that are summed side by side */

/* Weight in the stack of expert i of those that rows train; 0 if it knows nothing, or predicts another residual. */
static hsep_real linearised_weight(hsep_averaged *model, hsep_int i, hsep_int kind)
{
    const hsep_int expert = HSEP_REGRESSIONS + i;
    const int of_kind = hsep_averaged_kind_of(model, expert) == kind;
    return model->predicted[expert] && of_kind ? model->shares[expert] + hsep_averaged_moves(model, expert) : 0.0;
}

/* Experts whose disturbances a change passes through. */
static hsep_int hsep_linearised_experts(hsep_averaged *model)
{
    hsep_int count = 0;
    for (hsep_int i = 0; i < HSEP_N_REGRESSIONS; i++) {
        count += linearised_weight(model, i, HSEP_MODEL_RESIDUAL) > 0.0;
    }
    return count;
}

/* The response of an expert, (horizon + 3,), to a change: of the command, or of the features of x_pb. */
static hsep_real *linearised_response(hsep_linearised *self, hsep_int i)
{
    return hsep_at(self, self->response) + i * (self->horizon + LINEARISED_TOGETHER - 1);
}

static hsep_real hsep_linearised_lay_out(hsep_linearised *self, const hsep_predictor_parameters *parameters)
{
    const hsep_real n = (hsep_real)hsep_predicted(parameters), horizon = (hsep_real)parameters->horizon;
    const hsep_real padded = horizon + (LINEARISED_TOGETHER - 1), lags = (hsep_real)parameters->settings.p;
    const hsep_real filter = hsep_physics_lay_out(&(hsep_physics){0}, parameters);
    hsep_real end = HSEP_WORDS(hsep_linearised);
    self->n = hsep_predicted(parameters);
    self->horizon = parameters->horizon;
    self->count = hsep_disturbances_count(parameters);
    self->slopes = hsep_take(&end, n * (hsep_real)self->count);
    self->gains = hsep_take(&end, n * LINEARISED_GAINS * HSEP_N_REGRESSIONS);
    self->shrink = hsep_take(&end, n * HSEP_N_REGRESSIONS);
    self->commands = hsep_take(&end, 1.0 + horizon);
    self->velocity = hsep_take(&end, horizon + LINEARISED_BEFORE);
    self->position = hsep_take(&end, horizon + LINEARISED_BEFORE);
    self->base = hsep_take(&end, horizon);
    self->response = hsep_take(&end, padded * HSEP_N_REGRESSIONS);
    self->run = hsep_take(&end, padded * HSEP_PHYSICS_ABREAST);
    self->lags = hsep_take(&end, HSEP_LANES_MOST * (lags + (LINEARISED_TOGETHER - 1)));
    self->disturbance = hsep_take(&end, padded * HSEP_PHYSICS_ABREAST);
    self->drive = hsep_take(&end, padded * HSEP_PHYSICS_ABREAST);
    self->physics = hsep_take_block(&end, filter);
    self->filters = hsep_take_block(&end, HSEP_PHYSICS_ABREAST * filter);
    return end * sizeof(hsep_real);
}

static void hsep_linearised_init(hsep_linearised *self, const hsep_predictor_parameters *parameters)
{
    (void)hsep_linearised_lay_out(self, parameters);
    hsep_physics_init(hsep_part(self, self->physics), parameters);
}

/* Index of a disturbance's first weight among the weights of an expert. */
static hsep_int linearised_first(const hsep_linearised *self, const hsep_averaged *model)
{
    return model->n_static - 2 * self->count;
}

/* Gains of an expert, (n,) each, from a change of v_d, x and v to its prediction: of friction, position and damping and
 * of their differences, as filters of only v_d and x. weights: of the disturbances, then of their differences. */
static void linearised_gains(hsep_linearised *self, const hsep_real weights[], hsep_real T_s, hsep_real gains[])
{
    const hsep_real *slopes = hsep_at_const(self, self->slopes);
    const hsep_int n = self->n;
    hsep_real *now = gains, *before = gains + n, *x_now = gains + 2 * n, *x_before = gains + 3 * n;
    hsep_real *x_earlier = gains + 4 * n, last[3] = {0.0}; /* of the differences, at the sample before */
    for (hsep_int k = 0; k < n; k++, slopes += self->count) {
        hsep_real given[2][3];
        for (hsep_int part = 0; part < 2; part++) {
            const hsep_real *w = weights + part * self->count;
            hsep_real friction = 0.0;
            hsep_real of_position = w[HSEP_DISTURBANCES_STIFFNESS] * slopes[HSEP_DISTURBANCES_STIFFNESS];
            for (hsep_int i = 0; i < HSEP_FEATURES_N_FRICTION; i++) {
                friction += slopes[i] * w[i];
            }
            for (hsep_int i = HSEP_FEATURES_N_LASTING; i < self->count; i++) {
                of_position += w[i] * slopes[i];
            }
            given[part][0] = friction;
            given[part][1] = of_position;
            given[part][2] = w[HSEP_DISTURBANCES_DAMPING] * slopes[HSEP_DISTURBANCES_DAMPING] / T_s;
        }
        /* g_d v_d + g_x x + g_v v + h_d v_d + h_x x + h_v v - (the last three, a sample before), v = (x - x-) / T_s */
        now[k] = given[0][0] + given[1][0];
        before[k] = -last[0];
        x_now[k] = (given[0][1] + given[1][1]) + (given[0][2] + given[1][2]);
        x_before[k] = -(given[0][2] + given[1][2]) - (last[1] + last[2]);
        x_earlier[k] = last[2];
        memcpy(last, given[1], sizeof last);
    }
}

/* Add the response of the changes of the command over spans. */
static void linearised_span(hsep_linearised *self, const hsep_real weights[], hsep_int dead_time, hsep_real to[])
{
    const hsep_real *commands = hsep_at(self, self->commands);
    for (hsep_int begin = 0, end = HSEP_FEATURES_SPAN, i = 0; i < HSEP_FEATURES_N_SPANS; i++) {
        for (hsep_int u = dead_time + begin; u < self->horizon; u++) {
            const hsep_int after = u - dead_time;
            to[u] += weights[i] * (commands[1 + after - begin] - commands[after >= end ? 1 + after - end : 0]);
        }
        begin = end;
        end *= HSEP_FEATURES_SPAN;
    }
}

/* Response of an expert of the command to the increments of a change of n samples, from rest, (horizon,). */
static void linearised_of_increments(
    hsep_linearised *self, const hsep_expert *expert, hsep_int n, hsep_int dead_time, hsep_real to[])
{
    const hsep_real *weights = hsep_expert_weights(expert), *lag_weights = weights + expert->n_static;
    const hsep_real *commands = hsep_at(self, self->commands);
    hsep_real *run = hsep_at(self, self->run);
    for (hsep_int u = 0; u < self->horizon; u++) {
        const hsep_int end = dead_time + n; /* the command changes in samples dead_time ... end */
        hsep_real drive = 0.0;
        for (hsep_int i = u + 1 > end ? u + 1 - end : 1; i < expert->n_static && i + dead_time <= u + 1; i++) {
            const hsep_real *before = commands + (u + 1 - i - dead_time);
            drive += weights[i] * (before[1] - before[0]);
        }
        hsep_real *e = run + (self->horizon - 1 - u);
        *e = hsep_recur(drive, lag_weights, e + 1, hsep_min(u, expert->p));
        to[u] = *e;
    }
}

/* Slopes are (n, count), sample after sample: of each friction with the commanded velocity, s/m, of the stiffness with
 * the position, m, of the damping with its velocity, m/s, and of what repeats with the position, 1/m. */
static void linearised_slopes(
    hsep_linearised *self, hsep_averaged *model, const hsep_real x_d[], const hsep_real x_pb[], hsep_real reach)
{
    const hsep_disturbances *disturbances = hsep_averaged_disturbances(model);
    const hsep_real scale = model->forecast_scale, half = reach * scale, *x = hsep_at(model, model->x);
    hsep_real last = disturbances->before.x_d, *slopes = hsep_at(self, self->slopes);
    hsep_real spread[HSEP_FEATURES_N_FRICTION], steepest[HSEP_FEATURES_N_FRICTION];
    for (hsep_int i = 0; i < HSEP_FEATURES_N_FRICTION; i++) {
        spread[i] = hsep_disturbances_spread(scale, i);
        steepest[i] = half > 0.0 ? hsep_tanh(2.0 * half / spread[i]) / (2.0 * half) : 1.0 / spread[i];
    }
    for (hsep_int j = self->n; j-- > 0; slopes += self->count) {
        const hsep_real v_d = (x_d[j] - last) / disturbances->T_s;
        last = x_d[j];
        for (hsep_int i = 0; i < HSEP_FEATURES_N_FRICTION; i++) {
            /* tanh a - tanh b = tanh(a - b) (1 - tanh a tanh b), which cancels nothing where a and b are close */
            const hsep_real sign = hsep_tanh((v_d + half) / spread[i]);
            const hsep_real other = half > 0.0 ? hsep_tanh((v_d - half) / spread[i]) : sign;
            slopes[i] = (1.0 - sign * other) * steepest[i];
        }
        const hsep_real v = hsep_disturbances_damped_velocity(disturbances, x_pb, x, self->n, j);
        slopes[HSEP_DISTURBANCES_STIFFNESS] = 2.0 * hsep_fabs(x[j]);
        slopes[HSEP_DISTURBANCES_DAMPING] = 2.0 * hsep_fabs(v);
        if (self->count > HSEP_FEATURES_N_LASTING) {
            const hsep_real angle = hsep_disturbances_angle(disturbances, x[j]);
            const hsep_real turns = HSEP_TWO_PI / disturbances->period;
            slopes[HSEP_FEATURES_N_LASTING] = turns * hsep_cos(angle);
            slopes[HSEP_FEATURES_N_LASTING + 1] = -turns * hsep_sin(angle);
        }
    }
}

/* Begin to linearise a model that has learned, for a change of the commands that may begin at any sample of the
 * horizon: what does not depend on the commands. change: (horizon,) m, oldest first, 0 after the first n;
 * passed: the same after G_pb. */
static void hsep_linearised_begin(
    hsep_linearised *self, hsep_averaged *model, const hsep_real change[], const hsep_real passed[], hsep_int n)
{
    const hsep_int first = linearised_first(self, model);
    const hsep_real T_s = hsep_averaged_disturbances(model)->T_s;
    hsep_real *commands = hsep_at(self, self->commands); /* the change as x_d, v_d and x */
    hsep_real *velocity = hsep_at(self, self->velocity) + LINEARISED_BEFORE;
    hsep_real *position = hsep_at(self, self->position) + LINEARISED_BEFORE;
    for (hsep_int u = 0; u < self->horizon; u++) {
        commands[1 + u] = change[u];
        velocity[u] = (commands[1 + u] - commands[u]) / T_s;
        position[u] = passed[u];
    }
    self->moves = hsep_min(n + 2, self->horizon);
    /* What is neither friction nor stiffness: the change filtered by G_pb, and as late as the experts of the command
     * take it, and their response to it */
    const hsep_int dead_time = hsep_averaged_command(model)->dead_time;
    hsep_real *base = hsep_at(self, self->base);
    hsep_copy(base, passed, self->horizon);
    for (hsep_int i = 0; i < HSEP_N_REGRESSIONS; i++) {
        const hsep_expert *expert = hsep_averaged_expert(model, HSEP_REGRESSIONS + i);
        const hsep_real weight = linearised_weight(model, i, HSEP_COMMAND_RESIDUAL);
        if (linearised_weight(model, i, HSEP_MODEL_RESIDUAL) > 0.0) {
            const hsep_int n_passed = first - 1 - HSEP_FEATURES_N_SPANS;
            const hsep_real *weights = hsep_expert_weights(expert) + 1;
            hsep_real *response = linearised_response(self, i), *difference = hsep_at(self, self->run);
            hsep_zero(response, self->horizon);
            hsep_copy(difference, passed, self->horizon);
            for (hsep_int j = 0; j < n_passed; j++) { /* of x_pb itself and its differences */
                hsep_axpy(response, weights[j], difference, self->horizon);
                for (hsep_int u = self->horizon; u-- > 1;) {
                    difference[u] -= difference[u - 1];
                }
            }
            linearised_span(self, weights + n_passed, dead_time, response);
        } else if (weight > 0.0) {
            linearised_of_increments(self, expert, n, dead_time, linearised_response(self, i));
            for (hsep_int u = 0; u < self->horizon; u++) {
                base[u] += weight * ((u < dead_time ? 0.0 : commands[1 + u - dead_time]) - passed[u]);
            }
        }
    }
}

/* Linearise at commands x_d that the model was last tried with, with the response x_pb, both (n,), m, newest first.
 * reach: half of the change of velocity that friction's slope is taken over, in velocity scales; 0: the tangent. */
static void hsep_linearised_at(
    hsep_linearised *self, hsep_averaged *model, const hsep_real x_d[], const hsep_real x_pb[], hsep_real reach)
{
    const hsep_int n = self->n, first = linearised_first(self, model);
    linearised_slopes(self, model, x_d, x_pb, reach);
    for (hsep_int i = 0; i < HSEP_N_REGRESSIONS; i++) {
        const hsep_expert *expert = hsep_averaged_expert(model, HSEP_REGRESSIONS + i);
        const hsep_real of_model = linearised_weight(model, i, HSEP_MODEL_RESIDUAL);
        const hsep_real weight = of_model + linearised_weight(model, i, HSEP_COMMAND_RESIDUAL); /* one is 0 */
        const hsep_real recalled = hsep_averaged_moves(model, HSEP_REGRESSIONS + i);
        const hsep_real *e = hsep_at_const(expert, expert->unshrunk), *e_h = hsep_at_const(expert, expert->e_h);
        for (hsep_int k = 0, j = n - 1; weight > 0.0 && k < n; k++, j--) { /* what shrinking and bounds leave of it */
            const hsep_real left = e[j] == 0.0 ? hsep_at_const(expert, expert->shrinkage)[j] : e_h[j] / e[j];
            hsep_at(self, self->shrink)[i * n + k] = (weight - recalled) * left + recalled;
        }
        if (of_model > 0.0) {
            linearised_gains(
                self, hsep_expert_weights(expert) + first, hsep_averaged_disturbances(model)->T_s,
                hsep_at(self, self->gains) + i * LINEARISED_GAINS * n);
        }
    }
}

/* Disturbances in expert i by a change that begins at sample first, as column c of the columns abreast. */
static void linearised_disturbance(hsep_linearised *self, hsep_int i, hsep_int first, hsep_int c)
{
    const hsep_int n = self->n, count = self->horizon - first, moves = hsep_min(self->moves, count);
    const hsep_real *gains = hsep_at(self, self->gains) + i * LINEARISED_GAINS * n + (n - count);
    const hsep_real *x_2 = hsep_at(self, self->position), *x_1 = x_2 + 1, *x = x_1 + 1; /* the samples before, now */
    const hsep_real *v_1 = hsep_at(self, self->velocity) + 1, *v_d = v_1 + 1;
    const hsep_real *g0 = gains + 2 * n, *g1 = gains + 3 * n, *g2 = gains + 4 * n;
    hsep_real *restrict to = hsep_at(self, self->disturbance) + c;
    for (hsep_int u = 0; u < count; u++) {
        to[HSEP_PHYSICS_ABREAST * u] = g0[u] * x[u] + g1[u] * x_1[u] + g2[u] * x_2[u];
    }
    for (hsep_int u = 0; u < moves; u++) {
        to[HSEP_PHYSICS_ABREAST * u] += gains[u] * v_d[u] + gains[n + u] * v_1[u];
    }
}

/* The recursion of an expert with p lags from rest for columns abreast, e(u) := drive(u) + own(u) + sum_i w_i e(u - i),
 * some samples together, so that earlier samples are loaded once for all of them. e, drive: (count,
 * HSEP_PHYSICS_ABREAST); own: (count,), the part by the features of x_pb. */
static void linearised_run(
    const hsep_real lags[], hsep_int p, const hsep_real drive[], const hsep_real own[], hsep_real e[], hsep_int count)
{
    const hsep_lanes *w = hsep_lanes_const(lags);
    for (hsep_int u = 0; u < count; u += LINEARISED_TOGETHER) {
        const hsep_int before = hsep_min(u, p);
        for (int l = 0; l < HSEP_OF_FOUR; l++) { /* each sum has a name, and so a register */
            const hsep_lanes *from = hsep_lanes_const(drive + HSEP_PHYSICS_ABREAST * u) + l;
            hsep_lanes *now = hsep_lanes_at(e + HSEP_PHYSICS_ABREAST * u) + l;
            hsep_lanes s0 = from[0] + own[u], s1 = from[HSEP_OF_FOUR] + own[u + 1];
            hsep_lanes s2 = from[2 * HSEP_OF_FOUR] + own[u + 2], s3 = from[3 * HSEP_OF_FOUR] + own[u + 3];
            for (hsep_int i = 0; i < before; i++) {
                const hsep_lanes past = *(now - HSEP_OF_FOUR * (i + 1));
                s0 += w[i] * past;
                s1 += w[i + 1] * past;
                s2 += w[i + 2] * past;
                s3 += w[i + 3] * past;
            }
            s1 += w[0] * s0; /* samples of this group feed the later ones */
            s2 = (s2 + w[1] * s0) + w[0] * s1;
            s3 = ((s3 + w[2] * s0) + w[1] * s1) + w[0] * s2;
            now[0] = s0, now[HSEP_OF_FOUR] = s1, now[2 * HSEP_OF_FOUR] = s2, now[3 * HSEP_OF_FOUR] = s3;
        }
    }
}

/* Add what an expert of the physics model's residual makes of the change. */
static void linearised_add(
    hsep_linearised *self, hsep_averaged *model, hsep_int i, hsep_int first, hsep_int spacing, hsep_int count,
    hsep_real *const columns[HSEP_PHYSICS_ABREAST])
{
    const hsep_expert *expert = hsep_averaged_expert(model, HSEP_REGRESSIONS + i);
    const hsep_int parts = (self->horizon - first + LINEARISED_TOGETHER - 1) / LINEARISED_TOGETHER; /* of a recursion */
    const hsep_int padded = parts * LINEARISED_TOGETHER;
    hsep_real *run = hsep_at(self, self->run);
    const hsep_int words = self->filters - self->physics;
    hsep_physics *filters[HSEP_PHYSICS_ABREAST];          /* G_pb, each from rest */
    for (hsep_int c = 0; c < HSEP_PHYSICS_ABREAST; c++) { /* columns that are shorter, or none, end with zeros */
        const hsep_int begin = c < count ? first + c * spacing : self->horizon;
        linearised_disturbance(self, i, begin, c);
        for (hsep_int u = self->horizon - begin; u < padded; u++) {
            hsep_at(self, self->disturbance)[HSEP_PHYSICS_ABREAST * u + c] = 0.0;
        }
        filters[c] = hsep_part(self, self->filters + c * words);
        hsep_copy(filters[c], hsep_at(self, self->physics), words);
    }
    hsep_physics_abreast(
        filters, HSEP_PHYSICS_ABREAST, hsep_at(self, self->disturbance), hsep_at(self, self->drive), (size_t)padded);
    hsep_real *lags = hsep_at(self, self->lags); /* each as often as a vector has lanes, then zeros */
    for (hsep_int l = 0; l < HSEP_LANES * (expert->p + LINEARISED_TOGETHER - 1); l++) {
        lags[l] = l < HSEP_LANES * expert->p ? hsep_expert_weights(expert)[expert->n_static + l / HSEP_LANES] : 0.0;
    }
    linearised_run(lags, expert->p, hsep_at(self, self->drive), linearised_response(self, i), run, padded);
    for (hsep_int c = 0; c < count; c++) {
        const hsep_int length = self->horizon - first - c * spacing;
        const hsep_real *shrink = hsep_at(self, self->shrink) + i * self->n + (self->n - length);
        for (hsep_int u = 0; u < length; u++) {
            columns[c][u] += shrink[u] * run[HSEP_PHYSICS_ABREAST * u + c];
        }
    }
}

/* Changes of x_h, m, by that change of the commands where it begins at the samples first + c spacing of the horizon, c
 * < count <= HSEP_PHYSICS_ABREAST: columns[c] is (horizon - first - c spacing,). */
static void hsep_linearised_columns(
    hsep_linearised *self, hsep_averaged *model, hsep_int first, hsep_int spacing, hsep_int count,
    hsep_real *const columns[HSEP_PHYSICS_ABREAST])
{
    for (hsep_int c = 0; c < count; c++) { /* what does not pass through the disturbances */
        const hsep_int length = self->horizon - first - c * spacing;
        hsep_copy(columns[c], hsep_at(self, self->base), length);
        for (hsep_int i = 0; i < HSEP_N_REGRESSIONS; i++) {
            const hsep_real *shrink = hsep_at(self, self->shrink) + i * self->n + (self->n - length);
            const hsep_real *response = linearised_response(self, i);
            const int counts = linearised_weight(model, i, HSEP_COMMAND_RESIDUAL) > 0.0;
            for (hsep_int u = 0; counts && u < length; u++) {
                columns[c][u] += shrink[u] * response[u];
            }
        }
    }
    for (hsep_int i = 0; i < HSEP_N_REGRESSIONS; i++) {
        if (linearised_weight(model, i, HSEP_MODEL_RESIDUAL) > 0.0) {
            linearised_add(self, model, i, first, spacing, count, columns);
        }
    }
}

#endif

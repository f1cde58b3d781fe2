/* State of a residual model that can be trusted: its layout, beginning and check, and what it has learned. */
#include "hsep_averaged_model.h"

#include "hsep_math.h"
#include "hsep_range.h"

#include <stddef.h>
#include <string.h>

static const hsep_range trusted_ranges[] = {HSEP_LEARNED_RANGES};

/* Features of the rows of some evidence. */
static hsep_word trusted_n_features(const hsep_trusted *self, hsep_word kind)
{
    return kind == HSEP_OF_COMMAND ? 2 * HSEP_TRUST_LAGS_OF_COMMAND + 2 : self->n_static + self->p;
}

HSEP_API hsep_word hsep_trusted_kind_of(const hsep_trusted *self, hsep_word expert)
{
    const int doubts_command = expert == HSEP_DOUBTING && self->leading == HSEP_COMMAND;
    return expert == HSEP_COMMAND || doubts_command ? HSEP_OF_COMMAND : HSEP_OF_PHYSICS;
}

static hsep_expert_shape trusted_shape(const hsep_trusted *self, hsep_word expert)
{
    const hsep_word room = self->Np - self->early + HSEP_GRAM_TOGETHER;
    if (hsep_trusted_kind_of(self, expert) == HSEP_OF_COMMAND) {
        return (hsep_expert_shape){self->Np, self->n, HSEP_TRUST_LAGS_OF_COMMAND + 2, HSEP_TRUST_LAGS_OF_COMMAND, room};
    }
    const hsep_word p = expert == HSEP_STATIC ? 0 : self->p;
    return (hsep_expert_shape){self->Np, self->n, self->n_static, p, room};
}

/* Bytes of the block of an expert, whichever it is the counterpart of. */
static hsep_real trusted_expert_size(const hsep_trusted *self, hsep_word expert)
{
    const hsep_expert_shape shape = trusted_shape(self, expert), other = trusted_shape(self, HSEP_COMMAND);
    const hsep_real size = hsep_expert_size(&shape);
    return expert == HSEP_DOUBTING ? hsep_fmax(size, hsep_expert_size(&other)) : size;
}

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real trusted_lay_out(hsep_trusted *self, const hsep_residual_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    const hsep_trust_settings *trust = parameters->trust;
    const hsep_real Np = (hsep_real)settings->Np, n = (hsep_real)parameters->n, p = (hsep_real)settings->p;
    const hsep_real p_of_command = (hsep_real)HSEP_TRUST_LAGS_OF_COMMAND;
    hsep_real end = HSEP_WORDS(hsep_trusted);
    self->Np = settings->Np;
    self->n = parameters->n;
    self->p = settings->p;
    self->n_static = hsep_disturbances_n(parameters);
    self->late = hsep_late(settings);
    self->early = self->Np - (self->Np / 2 < HSEP_AVERAGING_AHEAD ? self->Np / 2 : HSEP_AVERAGING_AHEAD);
    self->T_s = settings->T_s;
    self->least_variance = settings->lambda;
    self->effect = trust->effect;
    self->given_variance = trust->noise_std * trust->noise_std;
    self->kept = trust->forgetting > 0.0 ? hsep_exp(-Np * settings->T_s / trust->forgetting) : 1.0;
    const hsep_real n_static = (hsep_real)self->n_static;
    self->largest = hsep_take(&end, n_static); /* behind what else is learned */
    self->forecast_largest = hsep_take(&end, n_static);
    self->x = hsep_take(&end, n);
    self->measured = hsep_take(&end, Np);
    self->accepted = hsep_take(&end, Np);
    self->bridged = hsep_take(&end, Np + hsep_fmax(p, p_of_command));
    self->e_0 = hsep_take(&end, Np + p_of_command);
    self->stacked = hsep_take(&end, HSEP_N_EXPERTS * n);
    self->variance = hsep_take(&end, n);
    self->rows = hsep_take(&end, n * n_static);
    self->disturbances = hsep_take_block(&end, hsep_disturbances_size(parameters));
    self->command = hsep_take_block(&end, hsep_command_size(parameters));
    for (hsep_word i = 0; i < HSEP_N_RESIDUALS; i++) {
        self->evidence[i] = hsep_take_block(&end, hsep_evidence_size(trusted_n_features(self, i)));
    }
    self->experts[HSEP_HOLD] = 0;
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        self->experts[i] = hsep_take_block(&end, trusted_expert_size(self, i));
    }
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_trusted_size(const hsep_residual_parameters *parameters)
{
    return trusted_lay_out(&(hsep_trusted){0}, parameters);
}

HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_residual_parameters *parameters, hsep_real start)
{
    memset(self, 0, (size_t)hsep_trusted_size(parameters));
    (void)trusted_lay_out(self, parameters);
    self->leading = HSEP_LAGGED;
    hsep_stack_init(&self->learned.stack);
    hsep_disturbances_init(hsep_trusted_disturbances(self), parameters, start);
    hsep_command_init(hsep_trusted_command(self), parameters);
    for (hsep_word i = 0; i < HSEP_N_RESIDUALS; i++) {
        hsep_evidence_init(hsep_trusted_evidence(self, i), trusted_n_features(self, i));
    }
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        const hsep_expert_shape shape = trusted_shape(self, i);
        hsep_expert_init(hsep_trusted_expert(self, i), &shape);
        self->learned.errors[i - HSEP_LAGGED].correlation = 1.0;
    }
}

HSEP_API int hsep_trusted_valid(const void *block, const hsep_residual_parameters *parameters)
{
    hsep_trusted got;
    int sound = HSEP_LAID_OUT(got, block, trusted_lay_out(&got, parameters)) &&
                (got.leading == HSEP_LAGGED || got.leading == HSEP_COMMAND) && got.followed <= got.Np &&
                got.known <= got.followed && got.reach.known <= 1 && hsep_within(&got.reach.farthest, 1, HSEP_PREDICTION_MAX) && got.settled <= 1 &&
                hsep_disturbances_valid(hsep_at_bytes(block, got.disturbances), parameters) &&
                hsep_command_valid(hsep_at_bytes(block, got.command), parameters);
    for (hsep_word i = 0; i < HSEP_N_RESIDUALS; i++) {
        sound = sound && hsep_evidence_valid(hsep_at_bytes(block, got.evidence[i]), trusted_n_features(&got, i));
    }
    for (hsep_word i = 0; i < HSEP_N_EXPERTS; i++) {
        const hsep_expert_shape shape = trusted_shape(&got, i);
        sound = sound && got.predicted[i] <= 1 &&
                (i == HSEP_HOLD || hsep_expert_valid(hsep_at_bytes(block, got.experts[i]), &shape));
    }
    return sound;
}

HSEP_API int hsep_trusted_doubts(hsep_trusted *self)
{
    return hsep_evidence_earlier(hsep_trusted_evidence(self, HSEP_OF_PHYSICS))->n_rows > 0.0;
}

HSEP_API hsep_solution *hsep_trusted_solution(hsep_trusted *self, hsep_word expert)
{
    const int trained = expert != HSEP_HOLD && (expert != HSEP_DOUBTING || hsep_trusted_doubts(self));
    return trained ? hsep_expert_solution(hsep_trusted_expert(self, expert)) : NULL;
}

/* Weight of the rows of earlier runs for an expert. */
static hsep_real trusted_weight(hsep_word expert) { return expert == HSEP_DOUBTING ? HSEP_TRUST_LESS : 1.0; }

HSEP_API hsep_solution *hsep_trusted_begun(hsep_trusted *self, hsep_word expert)
{
    hsep_solution *solution = hsep_trusted_solution(self, expert);
    if (solution != NULL && !solution->begun) {
        hsep_evidence *evidence = hsep_trusted_evidence(self, hsep_trusted_kind_of(self, expert));
        hsep_expert_begin_solution(hsep_trusted_expert(self, expert), evidence, trusted_weight(expert));
    }
    return solution;
}

HSEP_API void hsep_trusted_prepare_solutions(
    hsep_trusted *self, const hsep_residual_scale scales[], const hsep_expert_errors errors[])
{
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        const hsep_word kind = hsep_trusted_kind_of(self, i);
        const hsep_real square = scales[kind].largest_square, weight = trusted_weight(i);
        const hsep_real first = self->given_variance > 0.0 ? self->given_variance : HSEP_TRUST_FIRST_NOISE * square;
        const hsep_real least = hsep_fmin(self->least_variance, HSEP_TRUST_LEAST_NOISE * square);
        if (hsep_trusted_solution(self, i) != NULL) {
            hsep_expert_prepare(
                hsep_trusted_expert(self, i), hsep_trusted_evidence(self, kind), weight, &errors[i - HSEP_LAGGED],
                first, least);
        }
    }
}

HSEP_API hsep_word hsep_trusted_n_learned(const hsep_trusted *self)
{
    return sizeof self->learned / sizeof(hsep_real) + self->n_static;
}

HSEP_API int hsep_trusted_sound(const hsep_trusted *self)
{
    const hsep_learned *learned = &self->learned;
    hsep_real sum = 0.0;
    for (int i = 0; i < HSEP_N_EXPERTS; i++) {
        sum += learned->stack.weights[i];
    }
    return hsep_in_ranges(&learned->velocity_scale, hsep_trusted_n_learned(self), trusted_ranges) &&
           (learned->velocity_scale == 0.0 || learned->velocity_scale >= HSEP_FEATURES_LEAST_VELOCITY) &&
           sum <= 1.0 + HSEP_AVERAGING_ROUNDING;
}

HSEP_API void hsep_trusted_restart(hsep_trusted *self)
{
    hsep_learned *learned = &self->learned;
    hsep_expert_errors *doubting = &learned->errors[HSEP_DOUBTING - HSEP_LAGGED];
    for (hsep_word i = 0; i < HSEP_N_RESIDUALS; i++) {
        hsep_evidence_begin_run(hsep_trusted_evidence(self, i), HSEP_TRUST_CARRIED * (hsep_real)self->Np);
    }
    self->leading = hsep_stack_leader(&learned->stack);
    const hsep_expert_shape shape = trusted_shape(self, HSEP_DOUBTING);
    hsep_expert_init(hsep_trusted_expert(self, HSEP_DOUBTING), &shape);
    *doubting = (hsep_expert_errors){0.0, 1.0};
    self->reach.n_missing = self->reach.n_beyond = self->followed = self->known = 0;
    self->reach.farthest = 0.0;
    self->settled = 0;
    self->early_square = 0.0;
    hsep_stack_forget(&learned->stack, HSEP_DOUBTING);
    if (hsep_trusted_doubts(self)) {
        *doubting = learned->errors[self->leading - HSEP_LAGGED];
        hsep_stack_copy(&learned->stack, self->leading, HSEP_DOUBTING);
    }
    hsep_trusted_prepare_solutions(self, learned->scales, learned->errors);
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        hsep_solution *solution = hsep_trusted_begun(self, i);
        if (solution != NULL) {
            (void)hsep_solution_advance(solution, INFINITY, 0);
        }
    }
}

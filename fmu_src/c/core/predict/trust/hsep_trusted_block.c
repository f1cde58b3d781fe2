/* Memory of a residual model that can be trusted: its layout, beginning and check, and what it has learned. */
#include "hsep_trusted.h"

#include "hsep_math.h"
#include "hsep_range.h"
#include "hsep_trust_constants.h"
#include "hsep_trust_learned.h"

#include <stddef.h>
#include <string.h>

HSEP_API hsep_disturbances *hsep_trusted_disturbances(hsep_trusted *self)
{
    return (hsep_disturbances *)hsep_at(self, self->disturbances);
}

HSEP_API hsep_command *hsep_trusted_command(hsep_trusted *self) { return (hsep_command *)hsep_at(self, self->command); }

HSEP_API hsep_gram *hsep_trusted_evidence(hsep_trusted *self, hsep_evidence evidence)
{
    return (hsep_gram *)hsep_at(self, self->evidence[evidence]);
}

HSEP_API hsep_gram *hsep_trusted_earlier(hsep_trusted *self, hsep_evidence evidence)
{
    return (hsep_gram *)hsep_at(self, self->earlier[evidence]);
}

HSEP_API hsep_expert *hsep_trusted_expert(hsep_trusted *self, hsep_expert_place expert)
{
    return (hsep_expert *)hsep_at(self, self->experts[expert]);
}

HSEP_API hsep_word hsep_trusted_n(const hsep_predictor_settings *settings, const hsep_trust_settings *trust)
{
    return hsep_disturbances_n(settings->q, trust->period) + settings->p;
}

/* Features of the rows of some evidence. */
static hsep_word trusted_n_features(const hsep_trusted *self, hsep_word evidence)
{
    return evidence == HSEP_OF_COMMAND ? 2 * HSEP_TRUST_LAGS_OF_COMMAND + 2 : self->n_static + self->p;
}

HSEP_API int hsep_trusted_is_of_command(const hsep_trusted *self, hsep_word expert)
{
    return expert == HSEP_COMMAND || (expert == HSEP_DOUBTING && self->leading == HSEP_COMMAND);
}

static hsep_expert_shape trusted_shape(const hsep_trusted *self, hsep_word expert)
{
    const int of_command = hsep_trusted_is_of_command(self, expert);
    const hsep_word p = of_command ? HSEP_TRUST_LAGS_OF_COMMAND : self->p;
    const hsep_word n_static = of_command ? p + 2 : self->n_static;
    return (hsep_expert_shape){self->Np, self->n, n_static, expert == HSEP_STATIC ? 0 : p};
}

/* Bytes of the block of an expert, whichever it is the counterpart of. */
static hsep_real trusted_expert_size(const hsep_trusted *self, hsep_word expert)
{
    const hsep_expert_shape shape = trusted_shape(self, expert), other = trusted_shape(self, HSEP_COMMAND);
    const hsep_real size = hsep_expert_size(&shape);
    return expert == HSEP_DOUBTING ? hsep_fmax(size, hsep_expert_size(&other)) : size;
}

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real trusted_lay_out(hsep_trusted *self, const hsep_trusted_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    const hsep_trust_settings *trust = parameters->trust;
    const hsep_real Np = (hsep_real)settings->Np, n = (hsep_real)parameters->n, p = (hsep_real)settings->p;
    const hsep_real p_of_command = (hsep_real)HSEP_TRUST_LAGS_OF_COMMAND;
    const hsep_real n_static = (hsep_real)hsep_disturbances_n(settings->q, trust->period);
    hsep_real end = HSEP_WORDS(hsep_trusted);
    self->Np = settings->Np;
    self->n = parameters->n;
    self->p = settings->p;
    self->n_static = hsep_disturbances_n(settings->q, trust->period);
    self->late = settings->measurement_delay;
    self->T_s = settings->T_s;
    self->least_variance = settings->lambda;
    self->effect = trust->effect;
    self->given_variance = trust->noise_std * trust->noise_std;
    self->kept = trust->forgetting > 0.0 ? hsep_exp(-Np * settings->T_s / trust->forgetting) : 1.0;
    self->largest = hsep_take(&end, n_static);
    self->forecast_largest = hsep_take(&end, n_static);
    self->scales = hsep_take(&end, hsep_fmax(n_static, p_of_command + 2.0));
    self->x = hsep_take(&end, n);
    self->measured = hsep_take(&end, Np);
    self->accepted = hsep_take(&end, Np);
    self->bridged = hsep_take(&end, Np + hsep_fmax(p, p_of_command));
    self->e_0 = hsep_take(&end, Np + p_of_command);
    self->stacked = hsep_take(&end, 2.0 * n);
    self->variance = hsep_take(&end, n);
    self->rows = hsep_take(&end, n * n_static);
    self->disturbances = hsep_take_block(&end, hsep_disturbances_size(settings, trust->period, parameters->n_modes));
    self->command = hsep_take_block(&end, hsep_command_size(settings, parameters->n));
    for (hsep_word i = 0; i < HSEP_N_EVIDENCE; i++) {
        const hsep_real size = hsep_gram_size(trusted_n_features(self, i));
        self->evidence[i] = hsep_take_block(&end, size);
        self->earlier[i] = hsep_take_block(&end, size);
    }
    self->experts[HSEP_HOLD] = 0;
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        self->experts[i] = hsep_take_block(&end, trusted_expert_size(self, i));
    }
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_trusted_size(const hsep_trusted_parameters *parameters)
{
    return trusted_lay_out(&(hsep_trusted){0}, parameters);
}

HSEP_API void hsep_trusted_init(hsep_trusted *self, const hsep_trusted_parameters *parameters, hsep_real start)
{
    memset(self, 0, (size_t)hsep_trusted_size(parameters));
    (void)trusted_lay_out(self, parameters);
    self->leading = HSEP_LAGGED;
    hsep_stack_init(&self->stack);
    hsep_disturbances_init(
        hsep_trusted_disturbances(self), parameters->settings, parameters->trust->period, parameters->modes,
        parameters->n_modes, parameters->planned, start);
    hsep_command_init(hsep_trusted_command(self), parameters->settings, parameters->n);
    for (hsep_word i = 0; i < HSEP_N_EVIDENCE; i++) {
        const hsep_word features = trusted_n_features(self, i);
        hsep_gram_init(hsep_trusted_evidence(self, (hsep_evidence)i), features);
        hsep_gram_init(hsep_trusted_earlier(self, (hsep_evidence)i), features);
    }
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        const hsep_expert_shape shape = trusted_shape(self, i);
        hsep_expert_init(hsep_trusted_expert(self, (hsep_expert_place)i), &shape);
    }
}

HSEP_API void hsep_trusted_lead(hsep_trusted *self, hsep_expert_place expert)
{
    self->leading = expert;
    const hsep_expert_shape shape = trusted_shape(self, HSEP_DOUBTING);
    hsep_expert_init(hsep_trusted_expert(self, HSEP_DOUBTING), &shape);
}

HSEP_API int hsep_trusted_valid(const void *block, const hsep_trusted_parameters *parameters)
{
    hsep_trusted got;
    memcpy(&got, block, sizeof got);
    (void)trusted_lay_out(&got, parameters); /* changes nothing where it is sound */
    int sound = memcmp(&got, block, sizeof got) == 0 && (got.leading == HSEP_LAGGED || got.leading == HSEP_COMMAND) &&
                got.followed <= got.Np && got.known <= got.followed && got.reach_of_window.known <= 1 &&
                hsep_disturbances_valid(
                    hsep_at_bytes(block, got.disturbances), parameters->settings, parameters->trust->period,
                    parameters->n_modes, parameters->planned) &&
                hsep_command_valid(hsep_at_bytes(block, got.command), parameters->settings, parameters->n);
    for (hsep_word i = 0; i < HSEP_N_EVIDENCE; i++) {
        const hsep_word features = trusted_n_features(&got, i);
        sound = sound && hsep_gram_valid(hsep_at_bytes(block, got.evidence[i]), features) &&
                hsep_gram_valid(hsep_at_bytes(block, got.earlier[i]), features) && got.n_earlier[i] >= 0.0 &&
                got.n_earlier[i] <= HSEP_PREDICTION_MAX;
    }
    for (hsep_word i = 0; i < HSEP_N_EXPERTS; i++) {
        const hsep_expert_shape shape = trusted_shape(&got, i);
        sound = sound && got.predicted[i] <= 1 &&
                (i == HSEP_HOLD || hsep_expert_valid(hsep_at_bytes(block, got.experts[i]), &shape));
    }
    return sound;
}

/* Some of the numbers that are learned, and their range. */
typedef struct {
    hsep_real *first;
    hsep_word n;
    hsep_real least, most;
} trusted_part;

#define TRUSTED_PARTS 21

/* What rounding may have added to the sum of the stack's weights. */
static const hsep_real trusted_rounding = 1e-6;

/* All of them, in the order of a weights file. */
static void trusted_list(hsep_trusted *self, trusted_part parts[TRUSTED_PARTS])
{
    hsep_stack *stack = &self->stack;
    const trusted_part before[] = {
        {self->n_rows, HSEP_N_EVIDENCE, HSEP_LEARNED_N_ROWS},
        {&self->velocity_scale, 1, HSEP_LEARNED_MOTION},
        {&self->largest_step, 1, HSEP_LEARNED_MOTION},
        {&self->reach.fastest, 1, HSEP_LEARNED_MOTION},
        {&self->scale.largest_square, 1, HSEP_LEARNED_SCALE},
        {&self->scale.largest, 1, HSEP_LEARNED_SCALE},
        {&self->scale_of_command.largest_square, 1, HSEP_LEARNED_SCALE_OF_COMMAND},
        {&self->scale_of_command.largest, 1, HSEP_LEARNED_SCALE_OF_COMMAND}};
    const trusted_part behind[] = {
        {hsep_at(self, self->largest), self->n_static, HSEP_LEARNED_LARGEST},
        {stack->weights, HSEP_N_EXPERTS, HSEP_LEARNED_WEIGHTS},
        {stack->gram, HSEP_N_EXPERTS * HSEP_N_EXPERTS, HSEP_LEARNED_GRAM},
        {stack->cross, HSEP_N_EXPERTS, HSEP_LEARNED_CROSS},
        {stack->evidence, 2, HSEP_LEARNED_EVIDENCE}};
    memcpy(parts, before, sizeof before);
    parts += sizeof before / sizeof before[0];
    for (hsep_word i = HSEP_LAGGED; i < HSEP_N_EXPERTS; i++) {
        hsep_expert *expert = hsep_trusted_expert(self, (hsep_expert_place)i);
        parts[i - HSEP_LAGGED] = (trusted_part){&expert->noise_variance, 1, HSEP_LEARNED_NOISE_VARIANCES};
        parts[i - HSEP_LAGGED + HSEP_N_EXPERTS - 1] =
            (trusted_part){&expert->correlation, 1, HSEP_LEARNED_CORRELATIONS};
    }
    memcpy(parts + 2 * (HSEP_N_EXPERTS - 1), behind, sizeof behind);
}

HSEP_API hsep_word hsep_trusted_n_learned(hsep_trusted *self)
{
    trusted_part parts[TRUSTED_PARTS];
    hsep_word n = 0;
    trusted_list(self, parts);
    for (int i = 0; i < TRUSTED_PARTS; i++) {
        n += parts[i].n;
    }
    return n;
}

HSEP_API hsep_real *hsep_trusted_learned(hsep_trusted *self, hsep_word i)
{
    trusted_part parts[TRUSTED_PARTS];
    size_t part = 0;
    trusted_list(self, parts);
    for (; i >= parts[part].n; part++) {
        i -= parts[part].n;
    }
    return parts[part].first + i;
}

HSEP_API int hsep_trusted_sound(hsep_trusted *self)
{
    trusted_part parts[TRUSTED_PARTS];
    hsep_real sum = 0.0;
    int sound = 1;
    trusted_list(self, parts);
    for (int i = 0; i < TRUSTED_PARTS; i++) {
        for (hsep_word j = 0; j < parts[i].n; j++) { /* NaN is in no range */
            sound = sound && parts[i].first[j] >= parts[i].least && parts[i].first[j] <= parts[i].most;
        }
    }
    for (int i = 0; i < HSEP_N_EXPERTS; i++) {
        sum += self->stack.weights[i];
    }
    return sound && sum <= 1.0 + trusted_rounding;
}

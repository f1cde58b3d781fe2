/* State of an averaged residual model: its layout and beginning, and what it has learned. */
#include "hsep_averaged_model.h"

/* Features of the rows of some evidence. */
static hsep_int averaged_n_features(const hsep_averaged *self, hsep_int kind)
{
    return (kind == HSEP_COMMAND_RESIDUAL ? HSEP_COMMAND_FEATURES : self->n_static) + hsep_averaged_lags(self, kind);
}

/* Shape of an expert: as hsep_expert_lay_out has it. */
static hsep_expert averaged_shape(const hsep_averaged *self, hsep_int expert)
{
    const hsep_int kind = hsep_averaged_kind_of(self, expert), p = hsep_averaged_lags(self, kind);
    return (hsep_expert){
        .Np = self->Np,
        .n = self->n,
        .n_static = averaged_n_features(self, kind) - p,
        .p = hsep_expert_of(expert).has_lags ? p : 0};
}

/* Bytes of the block of an expert, whichever it is the counterpart of. */
static hsep_real averaged_expert_size(const hsep_averaged *self, hsep_int expert)
{
    hsep_expert shape = averaged_shape(self, expert), other = averaged_shape(self, HSEP_ARX_COMMAND);
    const hsep_real size = hsep_expert_lay_out(&shape);
    return hsep_expert_of(expert).is_fresh ? hsep_fmax(size, hsep_expert_lay_out(&other)) : size;
}

HSEP_API hsep_real hsep_averaged_lay_out(hsep_averaged *self, const hsep_predictor_parameters *parameters)
{
    const hsep_predictor_settings *settings = &parameters->settings;
    const hsep_averaging_settings *averaging = &parameters->averaging;
    const hsep_real Np = (hsep_real)settings->Np, n = (hsep_real)hsep_predicted(parameters);
    const hsep_real p_of_command = (hsep_real)HSEP_AVERAGING_LAGS_OF_COMMAND;
    hsep_real end = HSEP_WORDS(hsep_averaged);
    self->Np = settings->Np;
    self->n = hsep_predicted(parameters);
    self->p = settings->p;
    self->n_static = hsep_disturbances_n(parameters);
    self->late = hsep_late(settings);
    self->solving_from = self->Np - hsep_expert_ahead(self->Np);
    self->T_s = settings->T_s;
    self->least_variance = settings->lambda;
    self->effect = averaging->effect;
    self->given_variance = averaging->noise_std * averaging->noise_std;
    self->forgetting_factor = averaging->forgetting > 0.0 ? hsep_exp(-Np * settings->T_s / averaging->forgetting) : 1.0;
    const hsep_real n_static = (hsep_real)self->n_static;
    self->largest = hsep_take(&end, n_static); /* after what else is learned */
    self->forecast_largest = hsep_take(&end, n_static);
    self->x = hsep_take(&end, n);
    self->measured = hsep_take(&end, Np);
    self->accepted = hsep_take(&end, Np);
    self->e_0 = hsep_take(&end, Np + p_of_command);
    self->stacked = hsep_take(&end, HSEP_N_EXPERTS * n);
    const hsep_int half = (self->n - self->late) / (2 * self->Np);
    self->n_ahead = !parameters->compensates ? 0 : half > 0 ? half : 1;
    self->ahead = hsep_take(&end, (hsep_real)self->n_ahead * HSEP_N_EXPERTS * Np);
    self->recalled = hsep_take(&end, n);
    self->e_h = hsep_take(&end, n);
    self->variance = hsep_take(&end, n);
    self->rows = hsep_take(&end, n * n_static);
    self->disturbances = hsep_take_block(&end, hsep_disturbances_lay_out(&(hsep_disturbances){0}, parameters));
    self->command = hsep_take_block(&end, hsep_command_lay_out(&(hsep_command){0}, parameters));
    self->recall = hsep_take_block(&end, hsep_recall_lay_out(&(hsep_recall){0}, parameters));
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        self->evidence[i] =
            hsep_take_block(&end, hsep_warm_start_lay_out(&(hsep_warm_start){0}, averaged_n_features(self, i)));
    }
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        self->experts[i] = hsep_take_block(&end, averaged_expert_size(self, i));
    }
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_averaged_init(hsep_averaged *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    (void)hsep_averaged_lay_out(self, parameters);
    self->leading = HSEP_ARX_RESIDUAL;
    for (hsep_int i = 0; i < HSEP_N_STACKS; i++) {
        hsep_stack_init(&self->learned.stacks[i]);
    }
    for (hsep_int i = 0; i < self->n_ahead; i++) {
        hsep_averaged_keep_ahead(self, 0);
    }
    hsep_disturbances_init(hsep_averaged_disturbances(self), parameters, start);
    (void)hsep_command_lay_out(hsep_averaged_command(self), parameters);
    hsep_recall_init(hsep_averaged_recall(self), parameters);
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        hsep_warm_start_init(hsep_averaged_evidence(self, i), averaged_n_features(self, i));
    }
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        hsep_expert_init(hsep_averaged_expert(self, i), averaged_shape(self, i));
        self->learned.errors[i - HSEP_REGRESSIONS].correlation = 1.0;
    }
}

HSEP_API hsep_solution *hsep_averaged_solution(hsep_averaged *self, hsep_int expert)
{
    return !hsep_expert_of(expert).is_fresh || hsep_averaged_doubts(self)
               ? hsep_expert_solution(hsep_averaged_expert(self, expert))
               : NULL;
}

HSEP_API hsep_solution *hsep_averaged_begun(hsep_averaged *self, hsep_int expert)
{
    hsep_solution *solution = hsep_averaged_solution(self, expert);
    if (solution != NULL && !solution->begun) {
        hsep_warm_start *evidence = hsep_averaged_evidence(self, hsep_averaged_kind_of(self, expert));
        const hsep_gram *earlier = hsep_warm_start_earlier(evidence);
        hsep_solution_begin(
            solution, hsep_warm_start_of_run(evidence), earlier->n_rows > 0.0 ? earlier : NULL,
            hsep_expert_weight(expert));
    }
    return solution;
}

HSEP_API void hsep_averaged_prepare_solutions(
    hsep_averaged *self, const hsep_residual_scale scales[], const hsep_expert_errors errors[])
{
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        const hsep_int kind = hsep_averaged_kind_of(self, i);
        const hsep_real square = scales[kind].largest_square, weight = hsep_expert_weight(i);
        const hsep_real first = self->given_variance > 0.0 ? self->given_variance : HSEP_AVERAGING_FIRST_NOISE * square;
        const hsep_real least = hsep_fmin(self->least_variance, HSEP_AVERAGING_LEAST_NOISE * square);
        if (hsep_averaged_solution(self, i) != NULL) {
            hsep_expert_prepare(
                hsep_averaged_expert(self, i), hsep_averaged_evidence(self, kind), weight,
                &errors[i - HSEP_REGRESSIONS], first, least);
        }
    }
}

HSEP_API void hsep_averaged_restart(hsep_averaged *self)
{
    hsep_learned *learned = &self->learned;
    hsep_expert_errors *doubting = &learned->errors[HSEP_FRESH_START - HSEP_REGRESSIONS];
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        hsep_warm_start_begin_run(
            hsep_averaged_evidence(self, i), HSEP_AVERAGING_WARM_WINDOWS_MAX * (hsep_real)self->Np);
    }
    self->leading = hsep_stack_leader(&learned->stacks[HSEP_OF_PREDICTIONS]);
    hsep_expert_init(hsep_averaged_expert(self, HSEP_FRESH_START), averaged_shape(self, HSEP_FRESH_START));
    *doubting = (hsep_expert_errors){0.0, 1.0};
    self->gate = (hsep_gate){0};
    self->followed = self->known = 0;
    for (hsep_int i = 0; i < HSEP_N_STACKS; i++) {
        hsep_stack_forget(&learned->stacks[i], HSEP_FRESH_START);
        if (hsep_averaged_doubts(self)) {
            *doubting = learned->errors[self->leading - HSEP_REGRESSIONS];
            hsep_stack_copy(&learned->stacks[i], self->leading, HSEP_FRESH_START);
        }
    }
    hsep_averaged_prepare_solutions(self, learned->scales, learned->errors);
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        hsep_solution *solution = hsep_averaged_begun(self, i);
        if (solution != NULL) {
            (void)hsep_solution_advance(solution, INFINITY, 0);
        }
    }
}

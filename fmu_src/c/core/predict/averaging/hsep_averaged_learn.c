/* Learning of an averaged residual model. */
#include "hsep_averaged_model.h"

#include "hsep_cholesky.h"

HSEP_API void hsep_averaged_begin_in_motion(hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[])
{
    const hsep_int Np = self->Np, dead_time = hsep_averaged_command(self)->dead_time;
    const hsep_real step = x_d[Np - 2] - x_d[Np - 1], step_pb = x_pb[Np - 2] - x_pb[Np - 1];
    hsep_real *past = hsep_at(self, self->e_0) + Np;
    hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    hsep_disturbances_begin_in_motion(disturbances, x_d, x_pb, Np, self->forecast_scale);
    hsep_command *command = hsep_averaged_command(self);
    hsep_command_begin_in_motion(command, x_d[Np - 1], x_d[Np - 2]);
    hsep_command_take(command, x_d, Np);
    hsep_disturbances_command(
        disturbances, x_d, hsep_command_late(command, Np), x_pb, Np, self->forecast_scale, hsep_at(self, self->rows));
    for (hsep_int i = 0; i < HSEP_AVERAGING_LAGS_OF_COMMAND; i++) {
        past[i] = (x_pb[Np - 1] - step_pb * (hsep_real)(i + 1)) - (x_d[Np - 1] - step * (hsep_real)(dead_time + i + 1));
    }
}

/* Begin to follow a window: take over its scales; forget slower rows if it outgrows them. fold: rows so far fade. */
static void averaged_begin_window(hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], int fold)
{
    hsep_disturbances *disturbances = hsep_averaged_disturbances(self);
    hsep_command *command = hsep_averaged_command(self);
    hsep_learned *learned = &self->learned;
    const hsep_real first = hsep_fabs(x_pb[self->Np - 1] - disturbances->before.x_pb[0]);
    if (self->forecast_scale != learned->velocity_scale) {
        hsep_warm_start_forget(hsep_averaged_evidence(self, HSEP_MODEL_RESIDUAL));
        hsep_warm_start_believe_earlier(hsep_averaged_evidence(self, HSEP_COMMAND_RESIDUAL));
        for (hsep_int i = 0; i < HSEP_N_STACKS; i++) {
            hsep_stack_forget(&learned->stacks[i], HSEP_FRESH_START);
        }
    }
    for (hsep_int i = 0; fold && i < HSEP_N_RESIDUALS; i++) { /* of more rows than can be counted, half */
        hsep_warm_start *evidence = hsep_averaged_evidence(self, i);
        const int countable = hsep_warm_start_of_run(evidence)->n_rows < 0.5 * HSEP_EXACT;
        hsep_warm_start_discount(evidence, countable ? self->forgetting_factor : 0.5 * self->forgetting_factor);
    }
    learned->velocity_scale = self->forecast_scale;
    learned->largest_step = self->forecast_step;
    learned->fastest = hsep_fmax(learned->fastest, hsep_fmax(first, hsep_largest_step(x_pb, self->Np)));
    hsep_copy(hsep_at(self, self->largest), hsep_at(self, self->forecast_largest), self->n_static);
    const hsep_real fastest = hsep_fmax(learned->fastest, learned->velocity_scale * self->T_s);
    hsep_gate_begin(&self->gate, learned->scales[HSEP_MODEL_RESIDUAL].largest, fastest);
    hsep_command_take(command, x_d, self->Np);
    if (self->n > self->Np) { /* what was tried last went beyond the window */
        const hsep_real *late = hsep_command_late(command, self->Np);
        hsep_real *rows = hsep_at(self, self->rows);
        hsep_disturbances_command(disturbances, x_d, late, x_pb, self->Np, learned->velocity_scale, rows);
    }
    hsep_command_fill(command, self->Np, 0, self->Np);
    self->n_accepted = 0.0;
}

/* Features of the window as measured, and the residual of the command, from known on up to sample last - 1. */
static void averaged_take_rows(hsep_averaged *self, const hsep_real x_pb[], const hsep_real e[], hsep_int last)
{
    const hsep_int first = self->known, Np = self->Np;
    const hsep_real *late = hsep_command_late(hsep_averaged_command(self), Np);
    hsep_real *x = hsep_at(self, self->x), *e_0 = hsep_at(self, self->e_0), *rows = hsep_at(self, self->rows);
    for (hsep_int j = Np - last; j < Np - first; j++) {
        x[j] = x_pb[j] + e[j];
        e_0[j] = x[j] - late[j];
    }
    if (first > 0) { /* the velocity at the first of them */
        x[Np - first] = x_pb[Np - first] + e[Np - first];
    }
    hsep_disturbances_motion(hsep_averaged_disturbances(self), x_pb, x, Np, first, last, rows);
    self->known = last;
}

/* Learn the row [lags backwards | static features | residual] of sample k. rows: (Np, n_static); e: (Np + lags,), m. */
static void averaged_fold(hsep_averaged *self, hsep_int kind, hsep_int k, const hsep_real rows[], const hsep_real e[])
{
    hsep_gram *gram = hsep_warm_start_of_run(hsep_averaged_evidence(self, kind));
    const hsep_int p = hsep_averaged_lags(self, kind), n_static = gram->n - p;
    const hsep_real *lags = e + (self->Np - k);
    hsep_real *to = hsep_gram_row(gram);
    for (hsep_int i = 0; i < p; i++) {
        to[p - 1 - i] = lags[i];
    }
    hsep_copy(to + p, rows + k * n_static, n_static);
    to[gram->n] = lags[-1];
    /* After solving_from samples the next solutions may have begun. */
    for (hsep_int i = HSEP_REGRESSIONS; k >= self->solving_from && i < HSEP_REGRESSIONS_END; i++) {
        hsep_solution *solution = hsep_averaged_solution(self, i);
        if (hsep_averaged_kind_of(self, i) == kind && solution != NULL && solution->begun) {
            hsep_solution_row(solution, to, gram->n);
        }
    }
    hsep_gram_fold(gram);
}

/* Judge the experts by the residuals e of the first n samples of their window, one of which counts at least. */
static void averaged_judge_experts(
    hsep_averaged *self, const hsep_real e[], hsep_int n, hsep_residual_scale scales[], hsep_expert_errors errors[])
{
    const hsep_real *accepted = hsep_at(self, self->accepted);
    const hsep_real *residuals[HSEP_N_RESIDUALS] = {e, hsep_at(self, self->e_0)};
    const hsep_int first = self->Np - n;
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        if (self->predicted[i]) {
            hsep_expert_judge(
                hsep_averaged_expert(self, i), &errors[i - HSEP_REGRESSIONS], residuals[hsep_averaged_kind_of(self, i)],
                accepted, n, self->given_variance);
        }
    }
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        hsep_residual_scale_follow(
            &scales[i], residuals[i] + first, accepted + first, n, self->n_accepted, self->level);
    }
}

/* Prepare the next solutions with what is known of this window, whose residuals are e, so far. */
static void averaged_prepare(hsep_averaged *self, const hsep_real e[])
{
    hsep_residual_scale scales[HSEP_N_RESIDUALS];
    hsep_expert_errors errors[HSEP_N_REGRESSIONS];
    memcpy(scales, self->learned.scales, sizeof scales);
    memcpy(errors, self->learned.errors, sizeof errors);
    if (self->n_accepted > 0.0) {
        averaged_judge_experts(self, e, self->known, scales, errors); /* later ones are not bridged yet */
    }
    hsep_averaged_prepare_solutions(self, scales, errors);
}

/* Multiply-adds as which the beginning of a solution counts. */
static hsep_real averaged_of_beginning(const hsep_solution *solution)
{
    const hsep_int n = solution->n_head + solution->n_tail;
    return solution->begun ? 0.0 : HSEP_AVERAGED_OF_BEGINNING * hsep_triangle(n + 1);
}

/* Multiply-adds that the solutions take after this sample, with as many rows to come. */
static hsep_real averaged_left(hsep_averaged *self, hsep_int to_come)
{
    hsep_real sum = 0.0;
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        const hsep_solution *solution = hsep_averaged_solution(self, i);
        if (solution != NULL) {
            const hsep_int kind = hsep_averaged_kind_of(self, i);
            const hsep_gram *gram = hsep_warm_start_of_run(hsep_averaged_evidence(self, kind));
            const hsep_int rows = to_come + (solution->begun ? 0 : gram->waiting);
            sum += averaged_of_beginning(solution) + hsep_solution_left(solution, rows);
        }
    }
    return sum;
}

/* Go on with them after sample last - 1, in equal shares: before the last row comes all others are in their heads. */
static void averaged_advance(hsep_averaged *self, hsep_int last)
{
    const hsep_int left = self->Np - last, to_come = left - 1;
    const hsep_int waiting = hsep_warm_start_of_run(hsep_averaged_evidence(self, HSEP_COMMAND_RESIDUAL))->waiting;
    const hsep_int adds = waiting + to_come > 0 ? (waiting + to_come - 1) / HSEP_GRAM_TOGETHER : 0;
    hsep_real of_rows = 0.0; /* where four are added to the Gram matrices */
    for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
        const hsep_gram *gram = hsep_warm_start_of_run(hsep_averaged_evidence(self, i));
        of_rows += HSEP_AVERAGED_OF_GRAM * hsep_triangle(gram->n + 1);
    }
    const hsep_real added = waiting == 1 ? of_rows : 0.0; /* in this sample */
    const hsep_real all = added + of_rows * (hsep_real)adds + averaged_left(self, to_come);
    hsep_real amount = all / (hsep_real)left - added;
    for (hsep_int i = HSEP_REGRESSIONS; i < HSEP_REGRESSIONS_END; i++) {
        hsep_solution *solution = hsep_averaged_solution(self, i);
        if (solution != NULL && (amount > 0.0 || left == 1)) {
            amount -= averaged_of_beginning(solution);
            amount = hsep_solution_advance(hsep_averaged_begun(self, i), amount, left == 1);
        }
    }
}

/* Bridge the residuals from the last believed one to place begin, before which is the next one, if it is not 0: they
 * are off from the predicted ones as both are, linearly in time, or as the last one is; by nothing if it is before the
 * window. */
static void averaged_bridge(const hsep_averaged *self, hsep_real e[], hsep_int begin)
{
    const hsep_int known = self->Np - self->known;
    const hsep_real *e_h = hsep_at_const(self, self->e_h) + (self->n - self->Np);
    const hsep_real off = self->known > 0 ? e[known] - e_h[known] : 0.0;
    const hsep_real slope = begin > 0 ? (e[begin - 1] - e_h[begin - 1] - off) / (hsep_real)(known - begin + 1) : 0.0;
    for (hsep_int i = known; i-- > begin;) {
        e[i] = e_h[i] + (slope * (hsep_real)(known - i) + off);
    }
}

/* Judge the next sample; if it is believed, take it in with those since the last believed one. fold: learn it too. */
static void averaged_follow_sample(hsep_averaged *self, const hsep_real x_pb[], hsep_real e[], int fold)
{
    const hsep_int k = self->followed++, j = self->Np - 1 - k;
    const hsep_real measured = hsep_at(self, self->measured)[j] - x_pb[j];
    const int accepted = hsep_gate_judge(&self->gate, measured, self->T_s);
    hsep_at(self, self->accepted)[j] = accepted ? 1.0 : 0.0;
    if (accepted) {
        e[j] = measured;
        averaged_bridge(self, e, j + 1);
        averaged_take_rows(self, x_pb, e, k + 1);
        self->n_accepted += 1.0;
    }
    if (accepted && fold) {
        const hsep_command *command = hsep_averaged_command(self);
        averaged_fold(self, HSEP_MODEL_RESIDUAL, k, hsep_at(self, self->rows), e);
        averaged_fold(self, HSEP_COMMAND_RESIDUAL, k, hsep_at_const(command, command->rows), hsep_at(self, self->e_0));
    }
    if (fold && self->followed == self->solving_from) {
        averaged_prepare(self, e);
    }
}

HSEP_API void hsep_averaged_follow(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], hsep_int last)
{
    if (self->followed == 0 && last > 0) {
        averaged_begin_window(self, x_d, x_pb, 1);
    }
    const int begun = self->followed >= self->solving_from;
    for (hsep_int i = 0; i < HSEP_AVERAGED_PACE && self->followed < last; i++) {
        averaged_follow_sample(self, x_pb, e, 1);
    }
    if (begun && last < self->Np) {
        averaged_advance(self, last);
    }
}

/* Update the weights of the stack with the accepted samples that were published, and of that of plans with them and
 * what a plan stacked for the window, if one did; without plans both are the same. */
static void averaged_judge_stacks(hsep_averaged *self, const hsep_real e[])
{
    const hsep_real *accepted = hsep_at(self, self->accepted), *signals[HSEP_N_EXPERTS + 1];
    hsep_real *work = hsep_at(self, self->x), *ahead = hsep_at(self, self->ahead);
    hsep_stack *stack = &self->learned.stacks[HSEP_OF_PREDICTIONS], *of_plans = &self->learned.stacks[HSEP_OF_PLANS];
    hsep_stack_products products = {{{0.0}}, 0.0};
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        signals[i] = hsep_at(self, self->stacked) + (self->n - self->Np) + i * self->n;
    }
    signals[HSEP_N_EXPERTS] = e;
    hsep_stack_add(&products, signals, accepted, work, self->Np - (self->late < self->Np ? self->late : 0));
    if (products.n == 0.0) {
        return;
    }
    hsep_stack_update(stack, &products, self->least_variance, NULL);
    if (self->n_ahead == 0) {
        *of_plans = *stack;
        return;
    }
    for (hsep_int i = 0; i < HSEP_N_EXPERTS; i++) {
        signals[i] = ahead + i * self->Np;
    }
    if (hsep_within(ahead, HSEP_N_EXPERTS * self->Np, HSEP_PREDICTION_MAX)) { /* it was known */
        if (!hsep_averaged_doubts(self)) {                                    /* and is not forgotten since */
            hsep_zero(ahead + HSEP_FRESH_START * self->Np, self->Np);
        }
        hsep_stack_add(&products, signals, accepted, work, self->Np);
    }
    hsep_stack_update(of_plans, &products, self->least_variance, stack->weights);
}

/* Judge the experts and their stack by the measurement of their window. */
static void averaged_judge(hsep_averaged *self, const hsep_real e[])
{
    hsep_learned *learned = &self->learned;
    averaged_judge_experts(self, e, self->Np, learned->scales, learned->errors);
    averaged_judge_stacks(self, e);
    const hsep_stack *stack = &learned->stacks[HSEP_OF_PREDICTIONS];
    const hsep_int led = self->leading, fresh = HSEP_FRESH_START;
    const hsep_real largest = learned->scales[HSEP_MODEL_RESIDUAL].largest_square, unit = largest * (hsep_real)self->Np;
    /* Both began the run with the same evidence, so what they differ by has come in it. */
    const hsep_real of_led = stack->gram[led * (HSEP_N_EXPERTS + 1)] - 2.0 * stack->cross[led];
    const hsep_real of_fresh = stack->gram[fresh * (HSEP_N_EXPERTS + 1)] - 2.0 * stack->cross[fresh];
    const hsep_real seen = hsep_gram_square(hsep_warm_start_of_run(hsep_averaged_evidence(self, HSEP_MODEL_RESIDUAL)));
    if (hsep_averaged_doubts(self) && stack->weights[fresh] > HSEP_AVERAGING_DISCARD_ABOVE &&
        stack->evidence[0] + of_led > HSEP_AVERAGING_DISCARD_ERROR * largest * stack->evidence[1] &&
        (of_led - of_fresh) * (seen / unit) > HSEP_AVERAGING_DISCARD_HARM * unit) {
        /* All experts go on with only this run, and are judged anew; their solutions begin at once. */
        for (hsep_int i = 0; i < HSEP_N_RESIDUALS; i++) {
            hsep_warm_start_forget_earlier(hsep_averaged_evidence(self, i));
        }
        learned->errors[0] = learned->errors[HSEP_STATIC - HSEP_REGRESSIONS] = (hsep_expert_errors){0.0, 1.0};
        learned->errors[led - HSEP_REGRESSIONS] = learned->errors[fresh - HSEP_REGRESSIONS];
        for (hsep_int i = 0; i < HSEP_N_STACKS; i++) {
            hsep_stack_init(&learned->stacks[i]);
        }
        hsep_averaged_prepare_solutions(self, learned->scales, learned->errors);
    }
}

/* The level of a run: the mean of its first window's residuals, if the command moved by little beside it, else 0. */
static void averaged_level(hsep_averaged *self, const hsep_real x_d[], const hsep_real e[])
{
    const hsep_real level = hsep_dot(hsep_at(self, self->accepted), e, self->Np) / self->n_accepted;
    hsep_real least = hsep_averaged_disturbances(self)->before.x_d, most = least;
    for (hsep_int j = 0; j < self->Np; j++) {
        least = hsep_fmin(least, x_d[j]);
        most = hsep_fmax(most, x_d[j]);
    }
    self->level = most - least <= HSEP_AVERAGING_LITTLE * hsep_fabs(level) ? level : 0.0;
    self->is_levelled = 1;
}

HSEP_API void hsep_averaged_learn(
    hsep_averaged *self, const hsep_real x_d[], const hsep_real x_pb[], hsep_real e[], int fold)
{
    hsep_real *e_0 = hsep_at(self, self->e_0);
    if (self->followed == 0) {
        averaged_begin_window(self, x_d, x_pb, fold);
    }
    while (self->followed < self->Np) {
        averaged_follow_sample(self, x_pb, e, fold);
    }
    if (self->known < self->Np) { /* none is believed after it */
        averaged_bridge(self, e, 0);
        averaged_take_rows(self, x_pb, e, self->Np);
    }
    self->n_rejected += self->Np - (hsep_int)self->n_accepted;
    if (fold && !self->is_levelled && self->n_accepted > 0.0) {
        averaged_level(self, x_d, e);
    }
    hsep_disturbances_end(hsep_averaged_disturbances(self));
    hsep_recall_remember(hsep_averaged_recall(self), e, e_0, hsep_command_late(hsep_averaged_command(self), self->Np));
    if (fold && self->n_accepted > 0.0) {
        averaged_judge(self, e);
    }
    hsep_command_end(hsep_averaged_command(self), self->Np);
    hsep_copy(e_0 + self->Np, e_0, HSEP_AVERAGING_LAGS_OF_COMMAND);
    self->followed = self->known = 0;
}

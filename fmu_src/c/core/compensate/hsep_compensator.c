#include "hsep_compensator.h"

HSEP_API hsep_real hsep_compensator_lay_out(hsep_compensator *self, const hsep_predictor_parameters *parameters)
{
    const hsep_real preview = (hsep_real)parameters->preview, horizon = (hsep_real)parameters->horizon;
    hsep_real end = HSEP_WORDS(hsep_compensator);
    self->n_lost = parameters->n_lost;
    const hsep_int late = hsep_late(&parameters->settings);
    self->x_dm = hsep_take(&end, (hsep_real)(late + parameters->settings.Np)) + late;
    self->loads = hsep_take(&end, preview);
    self->load = hsep_take(&end, horizon);
    self->trial_x = hsep_take(&end, horizon + (hsep_real)parameters->settings.q);
    self->trial_e = hsep_take(&end, horizon + (hsep_real)parameters->settings.p);
    self->target = hsep_take(&end, horizon);
    self->spline_pb = hsep_take(&end, horizon);
    self->trial = hsep_take_block(&end, hsep_physics_lay_out(&(hsep_physics){0}, parameters)); /* up to planner */
    self->planner = hsep_take_block(&end, hsep_planner_lay_out(&(hsep_planner){0}, parameters));
    self->predictor = hsep_take_block(&end, hsep_predictor_lay_out(&(hsep_predictor){0}, parameters));
    if (parameters->averaging.averaging) {
        self->newton = hsep_take_block(&end, hsep_newton_lay_out(&(hsep_newton){0}, parameters));
    }
    return end * sizeof(hsep_real);
}

/* The physics model as it is now, for a trial. */
static hsep_physics *compensator_trial(hsep_compensator *self)
{
    const hsep_predictor *predictor = hsep_compensator_predictor(self);
    return hsep_copy(
        hsep_at(self, self->trial), hsep_at_const(predictor, predictor->physics), self->planner - self->trial);
}

HSEP_API void hsep_compensator_block_init(
    hsep_compensator *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    memset(self, 0, (size_t)hsep_compensator_lay_out(self, parameters));
    (void)hsep_compensator_lay_out(self, parameters);
    hsep_predictor_block_init(hsep_compensator_predictor(self), parameters, start);
    hsep_planner_init(hsep_compensator_planner(self), parameters, start);
    self->compensate = self->compensate_next = parameters->compensator.compensate;
    self->change_max_next = parameters->compensator.change_max;
    self->error_max = parameters->compensator.following_error_max;
    self->state = self->before = self->compensate > HSEP_SEP_PHYSICS ? HSEP_SEP_PHYSICS : self->compensate;
    for (hsep_int i = 1; i <= hsep_late(&parameters->settings); i++) {
        *(hsep_at(self, self->x_dm) - i) = start;
    }
    /* The spline filtered by the physics model from rest, which is constant. */
    hsep_physics *trial = compensator_trial(self);
    hsep_real *spline = hsep_at(self, self->spline_pb);
    const hsep_splines *splines = hsep_planner_splines(hsep_compensator_planner(self));
    for (hsep_int k = 0; k < parameters->horizon; k++) {
        spline[k] = hsep_physics_respond(trial, k < 4 * splines->spacing ? hsep_splines_shape(splines)[k] : 0.0);
    }
    if (self->newton) {
        hsep_newton_init(hsep_compensator_newton(self), parameters, hsep_compensator_planner(self), spline);
    }
}

static hsep_int compensator_horizon(const hsep_compensator *self)
{
    return hsep_planner_splines(hsep_part_const(self, self->planner))->horizon;
}

static hsep_newton_task compensator_task(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    return (hsep_newton_task){
        .predictor = predictor,
        .model = hsep_predictor_averaged(predictor),
        .planner = hsep_compensator_planner(self),
        .x_d = hsep_at(predictor, predictor->x_d),
        .load = hsep_at(self, self->load)};
}

/* target := x_d - the model's response to x_d under the remainder of the last plan; eq. (3) without a matrix. */
static void compensator_target(hsep_compensator *self, hsep_sep_state state)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_planner *planner = hsep_compensator_planner(self);
    const hsep_int horizon = compensator_horizon(self), Np = predictor->Np;
    const hsep_real *x_d = hsep_at(predictor, predictor->x_d), *load = hsep_at(self, self->load);
    hsep_real *target = hsep_at(self, self->target);
    hsep_real *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    hsep_physics *trial = compensator_trial(self);
    for (hsep_int k = 0; k < horizon; k++) {
        const hsep_real command = x_d[k] - predictor->start + hsep_planner_delta(planner, k) + load[k];
        x[horizon - 1 - k] = hsep_physics_respond(trial, command);
        target[k] = x_d[k] - predictor->start - x[horizon - 1 - k];
    }
    if (state == HSEP_SEP_HYBRID) {
        const hsep_recursion recursion = hsep_paper_recursion(hsep_predictor_paper(predictor), 1);
        hsep_copy(x + horizon, hsep_at(predictor, predictor->past_x) + Np, predictor->q);
        hsep_copy(e + horizon, hsep_at(predictor, predictor->past_e) + Np, predictor->p);
        hsep_recursion_run(&recursion, x, e, horizon, 0, horizon);
        for (hsep_int k = 0; k < horizon; k++) {
            target[k] -= e[horizon - 1 - k];
        }
    }
}

/* The spline filtered by the hybrid model, G_h = (1 + W_x / (1 - W_e)) G_pb, (horizon,), in place of a trial. */
static const hsep_real *compensator_filter_spline(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_recursion recursion = hsep_paper_recursion(hsep_predictor_paper(predictor), 0);
    const hsep_int horizon = compensator_horizon(self);
    const hsep_real *spline_pb = hsep_at(self, self->spline_pb);
    hsep_real *x = hsep_at(self, self->trial_x), *e = hsep_at(self, self->trial_e);
    for (hsep_int k = 0; k < horizon; k++) {
        x[horizon - 1 - k] = spline_pb[k];
    }
    hsep_zero(x + horizon, recursion.q);
    hsep_zero(e + horizon, recursion.p);
    hsep_recursion_run(&recursion, x, e, horizon, 0, horizon);
    for (hsep_int k = 0; k < horizon; k++) {
        x[k] = spline_pb[k] + e[horizon - 1 - k];
    }
    return x;
}

/* Whether all roots of z^p - w_e,1 z^(p-1) - ... - w_e,p are inside the unit circle: the Schur-Cohn test by step-down
 * recursion (Jury 1964). work: (2 p,). Cost: p^2 / 2 multiply-adds and p divisions. */
static int compensator_has_stable_poles(const hsep_recursion *recursion, hsep_real work[])
{
    const hsep_int p = recursion->p;
    hsep_real *a = work, *next = work + p;
    for (hsep_int i = 0; i < p; i++) {
        a[i] = -recursion->w_e[i];
    }
    for (hsep_int m = p; m-- > 0;) {
        const hsep_real reflection = a[m];
        if (!(hsep_fabs(reflection) < 1.0)) { /* NaN too */
            return 0;
        }
        /* a_i := (a_i - kappa a_(m-i)) / (1 - kappa^2) */
        const hsep_real inverse = 1.0 / ((1.0 - reflection) * (1.0 + reflection));
        for (hsep_int i = 0; i < m; i++) {
            next[i] = (a[i] - reflection * a[m - 1 - i]) * inverse;
        }
        hsep_real *swap = a;
        a = next;
        next = swap;
    }
    return 1;
}

/* Samples of a window that follow the last plan while one is made, not only one: spread needs differences. */
static hsep_int compensator_pinned(hsep_compensator *self)
{
    const hsep_int pinned = hsep_planner_pinned(hsep_compensator_planner(self));
    return pinned > 1 ? pinned : 0;
}

/* Set the commands of the window up to last - 1 and predict its position; eqs. (2) and (4). */
static void compensator_publish(hsep_compensator *self, hsep_int last)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_int Np = predictor->Np, first = predictor->n_published;
    const hsep_real *x_d = hsep_at(predictor, predictor->x_d), *load = hsep_at(self, self->load);
    hsep_real *x_dm = hsep_at(self, self->x_dm), *past_x = hsep_at(predictor, predictor->past_x);
    hsep_real *command = hsep_at(predictor, predictor->command);
    for (hsep_int k = first; k < last; k++) {
        x_dm[k] = x_d[k] + hsep_planner_delta(hsep_compensator_planner(self), k);
        command[Np - 1 - k] = x_dm[k] - predictor->start + load[k];
        past_x[Np - 1 - k] = hsep_physics_respond(hsep_predictor_physics(predictor), command[Np - 1 - k]);
    }
    if (!hsep_within(x_dm + first, last - first, HSEP_PREDICTION_MAX)) {
        predictor->divergence = HSEP_DIVERGES_X_DM;
    }
    if (self->newton) { /* the window's part of the preview, and what is late before it */
        const hsep_newton *averaged = hsep_compensator_newton(self);
        hsep_copy(
            hsep_at(predictor, predictor->e_h), hsep_at_const(averaged, averaged->e_h) + (averaged->horizon - Np),
            predictor->n);
    } else {
        hsep_predictor_predict(predictor, first, last);
    }
    hsep_predictor_publish(predictor, last);
    hsep_predictor_predict_std(predictor, 0, predictor->n);
}

/* Work on a plan that is due before the next sample. */
static void compensator_solve(hsep_compensator *self)
{
    const hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_int pinned = compensator_pinned(self), i = predictor->k % predictor->Np;
    const hsep_int left = i < pinned ? pinned - i : 0; /* samples that follow the last plan, this one among them */
    int done = left <= 1;
    if (self->newton) { /* it is followed when it is due, so nothing depends on when it is made */
        const hsep_newton_task task = compensator_task(self);
        hsep_newton_run(hsep_compensator_newton(self), &task, left);
        const hsep_int planned = hsep_compensator_newton(self)->planned; /* 0: off, or the last plan's remainder */
        self->state = !done ? self->state : planned || !self->compensate ? planned : self->before;
    } else { /* an equal share of the solver's steps, in halves; where no sample is pinned all, -1 */
        const hsep_int due = left > 0 ? 2 * ((HSEP_QP_STEPS + pinned - 1) / pinned) : (hsep_int)-1;
        done = 0;
        for (hsep_int half = 0; !done && half < due; half++) {
            done = hsep_planner_advance(hsep_compensator_planner(self)) == HSEP_PLAN_DONE;
        }
        if (done) {
            hsep_planner_carry_out(hsep_compensator_planner(self), hsep_at_const(predictor, predictor->x_d));
        }
    }
    if (done) {
        compensator_publish(self, predictor->Np);
    }
}

/* Begin a plan with a model; self->state: the model, or off if there is no plan. */
static hsep_plan_status compensator_try(hsep_compensator *self, hsep_sep_state state)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    compensator_target(self, state);
    const hsep_real *spline =
        state == HSEP_SEP_HYBRID ? compensator_filter_spline(self) : hsep_at(self, self->spline_pb);
    hsep_planner *planner = hsep_compensator_planner(self);
    hsep_planner_open(planner, hsep_at(predictor, predictor->x_d), 0, 1.0);
    hsep_planner_aim(planner, spline, hsep_at(self, self->target), planner->jerk_weight);
    const hsep_plan_status status = hsep_planner_solve(planner, HSEP_QP_STEPS);
    self->state = (hsep_int)(status == HSEP_PLAN_FAILED ? HSEP_SEP_OFF : state);
    return status;
}

/* Begin a plan on the paper's model, or on the physics model where the paper's must not plan, or one that ends
 * compensation; return whether it is left to solve. */
static int compensator_plan(hsep_compensator *self)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    hsep_paper *paper = hsep_predictor_paper(predictor);
    const hsep_recursion recursion = hsep_paper_recursion(paper, 0);
    hsep_plan_status status = HSEP_PLAN_FAILED;
    const hsep_int before = self->state;
    self->state = HSEP_SEP_OFF;
    if (self->compensate == HSEP_SEP_HYBRID && (hsep_real)predictor->k >= predictor->n_init &&
        hsep_paper_regression(paper)->n_rows > 0.0 &&
        compensator_has_stable_poles(&recursion, hsep_at(self, self->trial_e))) {
        status = compensator_try(self, HSEP_SEP_HYBRID);
    }
    if (status == HSEP_PLAN_FAILED && self->compensate != HSEP_SEP_OFF) {
        status = compensator_try(self, HSEP_SEP_PHYSICS);
    } else if (self->compensate == HSEP_SEP_OFF && before != HSEP_SEP_OFF) {
        hsep_planner_end(hsep_compensator_planner(self), hsep_at(predictor, predictor->x_d));
        status = hsep_planner_solve(hsep_compensator_planner(self), HSEP_QP_STEPS);
    }
    predictor->n_physics = self->state == HSEP_SEP_HYBRID ? 0 : predictor->Np;
    return status == HSEP_PLAN_BOUNDED;
}

HSEP_API int hsep_compensator_change(
    hsep_compensator *self, hsep_sep_state compensate, hsep_real change_max, hsep_real following_error_max)
{
    if (!(change_max > 0.0 && isfinite(change_max)) || (hsep_int)compensate > HSEP_SEP_HYBRID ||
        !(following_error_max >= 0.0 && isfinite(following_error_max))) {
        return 0;
    }
    self->compensate_next = (hsep_int)compensate;
    self->change_max_next = change_max;
    self->error_max = following_error_max;
    return 1;
}

HSEP_API void hsep_compensator_reset(hsep_compensator *self, int level)
{
    self->n_over = level && !self->was_reset ? 0 : self->n_over;
    self->was_reset = level != 0;
}

/* Whether no measurement came for so long that the change of the command fades. */
static int compensator_lost(const hsep_compensator *self) { return self->n_lost && self->n_missing == self->n_lost; }

HSEP_API void hsep_compensator_begin(hsep_compensator *self)
{
    hsep_planner *planner = hsep_compensator_planner(self);
    self->compensate = compensator_lost(self) || self->n_over == HSEP_N_OVER ? HSEP_SEP_OFF : self->compensate_next;
    if (hsep_planner_splines(planner)->share[0] != 1.0 / self->change_max_next) {
        hsep_splines_limit(hsep_part(planner, planner->splines), 0, self->change_max_next);
    }
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    hsep_predictor_begin(predictor);
    hsep_real *x_d = hsep_at(predictor, predictor->x_d);
    const hsep_int last = predictor->preview - 1;
    for (hsep_int k = predictor->preview; k < compensator_horizon(self); k++) { /* it goes on at its last velocity */
        x_d[k] = x_d[last] + (x_d[last] - x_d[last - 1]) * (hsep_real)(k - last);
    }
    if (self->newton) { /* which model planned is known when the plan is made */
        const hsep_newton_task task = compensator_task(self);
        self->before = self->state;
        predictor->n_physics = hsep_predictor_warm_up(predictor, 0);
        hsep_newton_begin(hsep_compensator_newton(self), &task, self->compensate, self->before);
    }
    const int solving = self->newton || compensator_plan(self);
    if (!solving) {
        hsep_planner_carry_out(planner, x_d);
    }
    compensator_publish(self, solving ? compensator_pinned(self) : predictor->Np);
    if (predictor->n_published < predictor->Np) {
        compensator_solve(self);
    }
}

/* Count following errors, m, that are missing (NaN), or too large, by themselves or in the mean with the error from the
 * modified command; return whether all is well, and may be learned: online/monitor.py, which says why. */
static int compensator_monitor(hsep_compensator *self, hsep_real error, hsep_real change)
{
    if (isnan(error)) {
        self->n_missing += self->n_missing < self->n_lost;
        return 1;
    }
    self->n_missing = 0;
    if (self->n_over < HSEP_N_OVER) {
        const hsep_real most = self->error_max * self->error_max;
        const hsep_real square = hsep_fmax(error * error, error * (error - change));
        self->n_over = most > 0.0 && square > most ? self->n_over + 1 : 0;
    }
    return self->n_over == 0;
}

HSEP_API void hsep_compensator_load(hsep_compensator *self, hsep_real x_load) { self->x_load = x_load; }

/* Take over the loads of the next window and of what follows it. */
static void compensator_begin_loads(hsep_compensator *self)
{
    const hsep_predictor *predictor = hsep_compensator_predictor(self);
    const hsep_int oldest = predictor->k % predictor->preview, newest = predictor->preview - oldest;
    const hsep_real *loads = hsep_at(self, self->loads);
    hsep_real *load = hsep_at(self, self->load);
    hsep_copy(load, loads + oldest, newest);
    hsep_copy(load + newest, loads, oldest);
    for (hsep_int k = predictor->preview; k < compensator_horizon(self); k++) {
        load[k] = load[k - 1];
    }
}

HSEP_API int hsep_compensator_sample(hsep_compensator *self, hsep_real x_d_ahead, hsep_real x_meas)
{
    hsep_predictor *predictor = hsep_compensator_predictor(self);
    self->first_load = predictor->k == 0 ? self->x_load : self->first_load;
    hsep_at(self, self->loads)[predictor->k % predictor->preview] = self->x_load - self->first_load;
    const hsep_int i = predictor->k % predictor->Np; /* of what is measured */
    const hsep_real *x_d = hsep_at(predictor, predictor->x_d) - predictor->late;
    hsep_real *x_dm = hsep_at(self, self->x_dm) - predictor->late;
    const hsep_real error = (predictor->early ? predictor->next : x_meas) - x_d[i];
    const int is_sound = compensator_monitor(self, error, x_dm[i] - x_d[i]) || !self->newton; /* the paper's: all */
    if (hsep_predictor_take_in(predictor, x_d_ahead, x_meas, is_sound)) {
        hsep_predictor_finish(predictor);
        hsep_copy(x_dm, x_dm + predictor->Np, predictor->late);
        hsep_planner_next(hsep_compensator_planner(self), hsep_at(predictor, predictor->x_d));
        compensator_begin_loads(self);
        hsep_compensator_begin(self);
        return 1;
    }
    if (predictor->n_published < predictor->Np) {
        compensator_solve(self);
    }
    return 0;
}

HSEP_API void hsep_compensator_read(const hsep_compensator *self, hsep_compensator_outputs *outputs)
{
    const hsep_predictor *predictor = hsep_part_const(self, self->predictor);
    const hsep_int i = predictor->k % predictor->Np;
    const int follows = self->newton && i < hsep_planner_pinned(hsep_part_const(self, self->planner));
    hsep_predictor_read(predictor, &outputs->predicted);
    if (!self->newton && self->state != HSEP_SEP_HYBRID) {
        outputs->predicted.x_h_std = 0.0; /* of x_pb it is not known */
    }
    outputs->x_dm = hsep_at_const(self, self->x_dm)[i];
    outputs->alarm = self->n_over == HSEP_N_OVER;
    outputs->state = outputs->alarm ? HSEP_SEP_TRIPPED : (hsep_sep_state)(follows ? self->before : self->state);
    outputs->no_measurement = compensator_lost(self);
}

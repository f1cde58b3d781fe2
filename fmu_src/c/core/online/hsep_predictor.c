#include "hsep_predictor.h"

/* Take a signal of the window, this long, and what is before it; return the offset of the window. */
static hsep_int predictor_take(hsep_real *end, hsep_real late, hsep_real count)
{
    return hsep_take(end, late + count) + (hsep_int)late;
}

/* Parts in which the averaged model predicts a window after its first sample, as variances are dear. */
static const hsep_int predictor_parts = 25;

HSEP_API hsep_real hsep_predictor_lay_out(hsep_predictor *self, const hsep_predictor_parameters *parameters)
{
    const hsep_real Np = (hsep_real)parameters->settings.Np, preview = (hsep_real)parameters->preview;
    const hsep_real horizon = (hsep_real)parameters->horizon;
    const hsep_real late = (hsep_real)hsep_late(&parameters->settings), n = Np + late;
    const hsep_real p = (hsep_real)parameters->settings.p, q = (hsep_real)parameters->settings.q;
    hsep_real end = HSEP_WORDS(hsep_predictor);
    self->Np = parameters->settings.Np;
    self->late = hsep_late(&parameters->settings);
    self->early = parameters->settings.measurement_delay < 0;
    self->n = self->Np + self->late;
    self->preview = parameters->preview;
    self->p = parameters->settings.p;
    self->q = parameters->settings.q;
    self->n_init = parameters->n_init;
    self->ahead = hsep_take(&end, preview); /* from here up to ahead_pb all begins at start: block_init */
    self->x_d = predictor_take(&end, late, horizon);
    self->x_pb = predictor_take(&end, late, Np);
    self->x_h = predictor_take(&end, late, Np);
    self->x_hold = predictor_take(&end, late, Np);
    self->ahead_pb = hsep_take(&end, parameters->compensates ? 0.0 : Np);
    self->command = hsep_take(&end, n);
    self->past_x = hsep_take(&end, n + q);
    self->past_e = hsep_take(&end, n + p);
    self->e_h = parameters->compensates ? hsep_take(&end, n + p) : self->past_e;
    self->physics = hsep_take_block(&end, hsep_physics_lay_out(&(hsep_physics){0}, parameters));
    self->uncertainty = hsep_take_block(&end, hsep_uncertainty_lay_out(&(hsep_uncertainty){0}, self->Np, self->n));
    if (parameters->averaging.averaging) {
        self->averaged = hsep_take_block(&end, hsep_averaged_lay_out(&(hsep_averaged){0}, parameters));
    } else {
        self->paper = hsep_take_block(&end, hsep_paper_lay_out(&(hsep_paper){0}, &parameters->settings));
    }
    if (parameters->averaging.averaging && !parameters->compensates) { /* the run's first state is corrected */
        self->motion = hsep_take_block(&end, hsep_start_lay_out(&(hsep_start){0}, parameters));
    }
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_predictor_block_init(
    hsep_predictor *self, const hsep_predictor_parameters *parameters, hsep_real start)
{
    memset(self, 0, (size_t)hsep_predictor_lay_out(self, parameters));
    (void)hsep_predictor_lay_out(self, parameters);
    self->start = self->next = start;
    self->n_published = self->n_physics = self->Np;           /* the first fill is not predicted */
    for (hsep_int i = self->ahead; i < self->ahead_pb; i++) { /* commands, and the four signals of the window */
        hsep_at(self, 0)[i] = start;
    }
    hsep_physics_init(hsep_predictor_physics(self), parameters);
    hsep_uncertainty_init(
        hsep_predictor_uncertainty(self), self->Np, self->n,
        hsep_uncertainty_first_variance(parameters->settings.lambda, parameters->averaging.noise_std));
    if (parameters->averaging.averaging) {
        hsep_averaged_init(hsep_predictor_averaged(self), parameters, start);
    } else {
        hsep_paper_init(hsep_predictor_paper(self), &parameters->settings);
    }
    if (self->motion) {
        hsep_start_init(hsep_part(self, self->motion), parameters);
    }
}

/* Whether commands and x_pb of the window will not change any more: they are all decided, and no motion before the run
 * will be found at the end of its first window. */
static int predictor_settled(hsep_predictor *self)
{
    const int is_first = self->motion && self->k < self->preview + self->Np;
    const hsep_start *motion = hsep_part_const(self, self->motion);
    return self->n_published == self->Np && !(is_first && hsep_start_moves(motion, hsep_at(self, self->command)));
}

/* Take in sample i of the window; measured: m, its position; command: m, the one that came with it. */
static void predictor_learn(hsep_predictor *self, hsep_int i, hsep_real measured, hsep_real command)
{
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    hsep_real *past_x = hsep_at(self, self->past_x), *past_e = hsep_at(self, self->past_e);
    if (averaged != NULL) {
        hsep_recall_append_command(hsep_averaged_recall(averaged), command - self->start);
        hsep_at(averaged, averaged->measured)[self->Np - 1 - i] = measured - self->start;
        if (self->learning && predictor_settled(self)) {
            hsep_averaged_follow(
                averaged, hsep_at(self, self->command) + self->late, past_x + self->late, past_e + self->late, i + 1);
        }
    } else if (self->learning) {
        const hsep_int j = self->n - 1 - i;
        hsep_paper_learn(hsep_predictor_paper(self), past_x + j, past_e + j);
    }
}

HSEP_API int hsep_predictor_take_in(hsep_predictor *self, hsep_real x_d_ahead, hsep_real x_meas, int is_sound)
{
    const hsep_real measured = self->early ? self->next : x_meas, learned = is_sound ? measured : NAN;
    const hsep_int i = self->k % self->Np, j = self->n - 1 - i, late = self->late;
    self->next = x_meas;
    /* It was measured late samples ago. */
    const hsep_real x_d = hsep_at(self, self->x_d - late)[i], x_pb = hsep_at(self, self->x_pb - late)[i];
    const hsep_real x_h = hsep_at(self, self->x_h - late)[i], x_hold = hsep_at(self, self->x_hold - late)[i];
    hsep_at(self, self->ahead)[self->k % self->preview] = x_d_ahead;
    hsep_at(self, self->past_e)[j] = learned - self->start - hsep_at(self, self->past_x)[j]; /* e_pb = x - x_pb */
    predictor_learn(self, i, learned, x_d_ahead);
    if (self->k >= self->preview + late && !isnan(measured)) {
        self->residual = measured - x_pb;
    }
    if (self->k >= self->preview + late && (hsep_real)self->k >= self->n_init + (hsep_real)late && !isnan(measured)) {
        self->n_measured++;
        self->sum_e += (measured - x_d) * (measured - x_d);
        self->sum_pb += (measured - x_pb) * (measured - x_pb);
        self->sum_h += (measured - x_h) * (measured - x_h);
        self->sum_hold += (measured - x_hold) * (measured - x_hold);
    }
    self->k++;
    return i + 1 == self->Np;
}

/* Correct the state at the beginning of the run, if its first residuals tell that it was in motion. */
static void predictor_start(hsep_predictor *self)
{
    const hsep_int Np = self->Np, late = self->late;
    hsep_start *motion = hsep_part(self, self->motion);
    hsep_uncertainty *uncertainty = hsep_predictor_uncertainty(self);
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    hsep_real *command = hsep_at(self, self->command), *past_x = hsep_at(self, self->past_x);
    hsep_real *e = hsep_at(self, self->past_e) + late, *work = hsep_at(averaged, averaged->x);
    const hsep_real *e_h = hsep_at(uncertainty, uncertainty->e_h) + late;
    for (hsep_int j = 0; j < Np; j++) {
        work[j] = e[j] - e_h[j];
    }
    if (hsep_start_estimate(motion, command, work)) {
        hsep_axpy(e, 1.0, past_x + late, Np);
        hsep_start_apply(motion, command, past_x, hsep_at(self, self->ahead_pb), hsep_predictor_physics(self));
        hsep_axpy(e, -1.0, past_x + late, Np);
        hsep_averaged_begin_in_motion(averaged, command + late, past_x + late);
    }
}

HSEP_API void hsep_predictor_finish(hsep_predictor *self)
{
    const hsep_int n = self->n, late = self->late;
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    hsep_real *past_x = hsep_at(self, self->past_x), *past_e = hsep_at(self, self->past_e);
    if (self->motion && self->k == self->preview + self->Np) {
        predictor_start(self);
    }
    const int compensates = self->e_h != self->past_e; /* a compensator plans the first fill: it is what was before */
    if (averaged != NULL && (self->learning || compensates)) {
        hsep_averaged_learn(
            averaged, hsep_at(self, self->command) + late, past_x + late, past_e + late, self->learning != 0);
    }
    if (self->learning) {
        const hsep_real *accepted = averaged != NULL ? hsep_at(averaged, averaged->accepted) : NULL; /* all */
        hsep_uncertainty_learn(hsep_predictor_uncertainty(self), past_e + late, accepted);
    }
    hsep_copy(past_x + n, past_x + late, self->q); /* q < Np, p <= Np: they do not overlap */
    hsep_copy(past_e + n, past_e + late, self->p);
}

HSEP_API void hsep_predictor_begin(hsep_predictor *self)
{
    const hsep_int n = self->n, oldest = self->k % self->preview, newest = self->preview - oldest;
    const hsep_real *ahead = hsep_at(self, self->ahead), *past_e = hsep_at(self, self->past_e);
    const hsep_averaged *averaged = hsep_predictor_averaged(self);
    hsep_real *x_d = hsep_at(self, self->x_d), *e_h = hsep_at(self, self->e_h);
    /* The samples of the last window that are not measured yet go before this one. */
    const hsep_int newest_first[2] = {self->command, self->past_x};
    const hsep_int oldest_first[4] = {self->x_d, self->x_pb, self->x_h, self->x_hold};
    for (int i = 0; i < 2; i++) {
        hsep_real *late = hsep_at(self, newest_first[i] + self->Np);
        hsep_copy(late, late - self->Np, self->late);
    }
    for (int i = 0; i < 4; i++) {
        hsep_real *late = hsep_at(self, oldest_first[i] - self->late);
        hsep_copy(late, late + self->Np, self->late);
    }
    hsep_copy(x_d, ahead + oldest, newest);
    hsep_copy(x_d + newest, ahead, oldest);
    if (e_h != past_e) {
        hsep_copy(e_h + n, past_e + n, self->p);
    }
    self->learning = self->k >= self->preview; /* the first fill is not learned */
    if (averaged == NULL) {                    /* the weights, eq. (6) */
        hsep_paper *paper = hsep_predictor_paper(self);
        hsep_regression_solve(hsep_paper_regression(paper), hsep_at(paper, paper->weights));
    }
    self->n_published = 0;
    self->held = self->residual;
    hsep_predictor_uncertainty(self)->least = averaged != NULL ? averaged->gate.farthest : 0.0;
}

HSEP_API void hsep_predictor_publish(hsep_predictor *self, hsep_int last)
{
    const hsep_int Np = self->Np, first = self->n_published;
    const hsep_real *past_x = hsep_at(self, self->past_x);
    hsep_real *x_pb = hsep_at(self, self->x_pb), *x_h = hsep_at(self, self->x_h), *e_h = hsep_at(self, self->e_h);
    hsep_real *x_hold = hsep_at(self, self->x_hold);
    for (hsep_int i = first; i < last; i++) {
        x_pb[i] = past_x[Np - 1 - i] + self->start;
        x_h[i] = i < self->n_physics ? x_pb[i] : x_pb[i] + e_h[Np - 1 - i]; /* Eq. (4) */
        x_hold[i] = x_pb[i] + self->held;
    }
    if (self->divergence == HSEP_CONVERGES && !hsep_within(x_pb + first, last - first, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_PB;
    } else if (self->divergence == HSEP_CONVERGES && !hsep_within(x_h + first, last - first, HSEP_PREDICTION_MAX)) {
        self->divergence = HSEP_DIVERGES_X_H;
    }
    self->n_published = last;
}

HSEP_API hsep_int hsep_predictor_warm_up(const hsep_predictor *self, hsep_int late)
{
    const hsep_real left = self->n_init - (hsep_real)(self->k - self->k % self->Np) + (hsep_real)late;
    const hsep_int n = self->Np + late;
    return left >= (hsep_real)n ? n : left > 0.0 ? (hsep_int)left : 0;
}

HSEP_API void hsep_predictor_predict_std(hsep_predictor *self, hsep_int first, hsep_int last)
{
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    const hsep_real *variance =
        averaged != NULL ? hsep_at(averaged, averaged->variance) + (averaged->n - self->n) : NULL;
    if (self->divergence == HSEP_CONVERGES) {
        hsep_uncertainty_predict(
            hsep_predictor_uncertainty(self), hsep_at(self, self->past_x), hsep_at(self, self->e_h), variance,
            hsep_predictor_warm_up(self, self->late), first, last);
    }
}

HSEP_API void hsep_predictor_predict(hsep_predictor *self, hsep_int first, hsep_int last)
{
    hsep_averaged *averaged = hsep_predictor_averaged(self);
    const hsep_real *past_x = hsep_at(self, self->past_x);
    hsep_real *e_h = hsep_at(self, self->e_h);
    if (averaged == NULL) {
        const hsep_recursion recursion = hsep_paper_recursion(hsep_predictor_paper(self), 1);
        hsep_recursion_run(&recursion, past_x, e_h, self->n, first, last); /* Eq. (4) */
    } else if (first == 0) {
        hsep_averaged_forecast(averaged, hsep_at(self, self->command), past_x, NULL, 0, e_h, last);
    } else {
        hsep_averaged_go_on(averaged, past_x, e_h, first, last, 1);
    }
}

/* Samples to predict next, after the published ones. */
static hsep_int predictor_part(hsep_predictor *self)
{
    const hsep_int part = (self->Np - 1) / predictor_parts + 1;
    if (hsep_predictor_averaged(self) == NULL) {
        return self->Np;
    }
    /* The first part comes with the weights; variances of the others side by side. */
    return self->n_published == 0 ? 1 : part > HSEP_SOLUTION_ABREAST ? part : HSEP_SOLUTION_ABREAST;
}

/* Predict the next samples of the window; with the first of them also the late samples, which are not measured yet. */
static void predictor_go_on(hsep_predictor *self)
{
    const hsep_int late = self->late, published = self->n_published;
    const hsep_int last = hsep_min(published + predictor_part(self), self->Np);
    const hsep_int first = published > 0 ? late + published : 0;
    hsep_predictor_predict(self, first, late + last);
    hsep_predictor_publish(self, last);
    hsep_predictor_predict_std(self, first, late + last);
}

HSEP_API int hsep_predictor_sample(hsep_predictor *self, hsep_real x_d_ahead, hsep_real x_meas)
{
    const hsep_int Np = self->Np;
    hsep_real *ahead_pb = hsep_at(self, self->ahead_pb);
    ahead_pb[self->k % Np] = hsep_physics_respond(hsep_predictor_physics(self), x_d_ahead - self->start);
    if (!hsep_predictor_take_in(self, x_d_ahead, x_meas, 1)) {
        if (self->n_published < Np) {
            predictor_go_on(self);
        }
        return 0;
    }
    hsep_predictor_finish(self);
    if (self->k == self->preview) { /* the first fill was not predicted */
        hsep_zero(hsep_at(self, self->past_e), self->n + self->p);
    }
    hsep_predictor_begin(self);
    /* Commands and x_pb as they came, eq. (2), after the late samples' values */
    hsep_real *command = hsep_at(self, self->command), *past_x = hsep_at(self, self->past_x);
    for (hsep_int i = 0; i < Np; i++) {
        command[Np - 1 - i] = hsep_at(self, self->x_d)[i] - self->start;
        past_x[Np - 1 - i] = ahead_pb[i];
    }
    /* of the whole window at once, though parts of it are published later */
    if (!hsep_within(past_x, self->n, HSEP_PREDICTION_MAX) && self->divergence == HSEP_CONVERGES) {
        self->divergence = HSEP_DIVERGES_X_PB;
    }
    self->n_physics = hsep_predictor_warm_up(self, 0);
    predictor_go_on(self);
    return 1;
}

HSEP_API void hsep_predictor_complete(hsep_predictor *self)
{
    while (self->n_published < self->Np && self->divergence == HSEP_CONVERGES) {
        predictor_go_on(self);
    }
}

HSEP_API hsep_real hsep_predictor_std(const hsep_predictor *self, hsep_int i)
{
    const hsep_uncertainty *uncertainty = hsep_part_const(self, self->uncertainty);
    return hsep_fmax(hsep_at_const(uncertainty, uncertainty->std)[self->Np - 1 - i], uncertainty->least);
}

static hsep_real predictor_rms(const hsep_predictor *self, hsep_real sum)
{
    return self->n_measured > 0 ? hsep_sqrt(sum / (hsep_real)self->n_measured) : 0.0;
}

HSEP_API void hsep_predictor_read(const hsep_predictor *self, hsep_predictor_outputs *outputs)
{
    const hsep_int i = self->k % self->Np;
    const hsep_averaged *averaged = hsep_part_const(self, self->averaged);
    outputs->x_d = hsep_at_const(self, self->x_d)[i];
    outputs->x_pb = hsep_at_const(self, self->x_pb)[i];
    outputs->x_h = hsep_at_const(self, self->x_h)[i];
    outputs->x_h_std = hsep_predictor_std(self, i);
    outputs->rms_e = predictor_rms(self, self->sum_e);
    outputs->rms_pb = predictor_rms(self, self->sum_pb);
    outputs->rms_h = predictor_rms(self, self->sum_h);
    outputs->rms_hold = predictor_rms(self, self->sum_hold);
    outputs->batch = self->k / self->Np;
    outputs->n_rejected = self->averaged ? averaged->n_rejected : 0;
    outputs->hybrid_active = i >= self->n_physics;
    outputs->divergence = (hsep_divergence)self->divergence;
}

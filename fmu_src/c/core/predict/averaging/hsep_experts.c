#include "hsep_experts.h"

HSEP_API void hsep_residual_scale_follow(
    hsep_residual_scale *self, const hsep_real residuals[], const hsep_real accepted[], hsep_int n, hsep_real count,
    hsep_real level)
{
    hsep_real sum = 0.0, moves = 0.0;
    for (hsep_int j = 0; j < n; j++) {
        const hsep_real residual = accepted[j] * residuals[j], move = accepted[j] * (residuals[j] - level);
        sum += residual * residual;
        moves += move * move;
        self->largest = hsep_fabs(residual) > self->largest ? hsep_fabs(residual) : self->largest;
    }
    self->largest_square = hsep_fmax(self->largest_square, sum / count);
    self->largest_move = hsep_fmax(self->largest_move, moves / count);
}

HSEP_API hsep_real hsep_residual_scale_effect(const hsep_residual_scale *self)
{
    const hsep_real square = self->largest_square, least = HSEP_EXPERTS_LEAST_MOVE * square;
    return hsep_sqrt(hsep_fmin(hsep_fmax(HSEP_EXPERTS_MOVES * self->largest_move, least), square));
}

/* Rows that may wait in its solution. */
static hsep_int expert_room(hsep_int Np) { return hsep_expert_ahead(Np) + HSEP_GRAM_TOGETHER; }

HSEP_API hsep_real hsep_expert_lay_out(hsep_expert *self)
{
    const hsep_real window = (hsep_real)self->n, lags = (hsep_real)self->p;
    hsep_real end = HSEP_WORDS(hsep_expert);
    self->lag_scales = hsep_take(&end, lags);
    self->run = hsep_take(&end, window + lags);
    self->unshrunk = hsep_take(&end, window + lags);
    self->e_h = hsep_take(&end, window);
    self->shrinkage = hsep_take(&end, window);
    self->response = hsep_take(&end, window + lags);
    self->squares = hsep_take(&end, window);
    self->variances = hsep_take(&end, window);
    self->solution = hsep_take_block(&end, hsep_solution_size(self->p, self->n_static, expert_room(self->Np)));
    return end * sizeof(hsep_real);
}

HSEP_API void hsep_expert_init(hsep_expert *self, hsep_expert shape)
{
    memset(self, 0, (size_t)hsep_expert_lay_out(&shape));
    *self = shape;
    hsep_solution_init(hsep_expert_solution(self), self->p, self->n_static, expert_room(self->Np));
    for (hsep_int i = 0; i < self->p; i++) {
        hsep_at(self, self->lag_scales)[i] =
            hsep_sqrt(hsep_pow(HSEP_AVERAGING_LAST_LAG, (hsep_real)i / (hsep_real)self->p));
    }
}

/* Least sum of squares that counts, of targets whose squares have a sum. */
static hsep_real expert_resolved(hsep_real square)
{
    return hsep_fmax(HSEP_EXPERTS_RESOLUTION, HSEP_SOLUTION_RESOLUTION) * square;
}

HSEP_API void hsep_expert_prepare(
    hsep_expert *self, hsep_warm_start *evidence, hsep_real weight, const hsep_expert_errors *errors, hsep_real first,
    hsep_real least)
{
    const hsep_gram *of_run = hsep_warm_start_of_run(evidence), *earlier = hsep_warm_start_earlier(evidence);
    const hsep_real of_earlier = earlier->n_rows > 0.0 ? weight * hsep_gram_square(earlier) : 0.0;
    const hsep_real resolved = expert_resolved(hsep_gram_square(of_run) + of_earlier);
    const hsep_real noise = errors->noise_variance > 0.0 ? errors->noise_variance : first;
    hsep_solution *solution = hsep_expert_solution(self);
    hsep_real *penalties = hsep_at(solution, solution->penalties) + self->n_static;
    const hsep_real *scales = hsep_at(self, self->lag_scales);
    self->variance = hsep_fmax(hsep_fmax(noise, least), resolved) * errors->correlation;
    for (hsep_int i = 0; i < self->p; i++) {
        penalties[i] = self->variance / (scales[i] * scales[i]);
    }
    hsep_solution_reset(solution);
}

HSEP_API void hsep_expert_solve(hsep_expert *self, hsep_real n_rows, const hsep_real scales[])
{
    hsep_solution *solution = hsep_expert_solution(self);
    hsep_real *penalties = hsep_at(solution, solution->penalties);
    for (hsep_int i = 0; i < self->n_static; i++) {
        penalties[i] = self->variance / (scales[i] * scales[i]);
    }
    const hsep_real square = hsep_solution_finish(solution);
    self->rows_variance = hsep_fmax(square, expert_resolved(solution->square)) / n_rows;
}

/* Free run of samples first ... last - 1, e(k) := w_static' phi(k) + sum_i w_i e(k - i), and within bounds; eq. (4). */
static void expert_free_run(hsep_expert *self, const hsep_real rows[], hsep_int first, hsep_int last)
{
    const hsep_int n_static = self->n_static;
    const hsep_real *weights = hsep_expert_weights(self), *lag_weights = weights + n_static;
    hsep_real *run = hsep_at(self, self->run), *unshrunk = hsep_at(self, self->unshrunk);
    rows += first * n_static;
    for (hsep_int k = first; k < last; k++, rows += n_static) {
        const hsep_int j = self->n - 1 - k;
        run[j] = hsep_recur(hsep_dot(weights, rows, n_static), lag_weights, run + j + 1, self->p);
        unshrunk[j] = isfinite(run[j]) ? hsep_clip(run[j], HSEP_EXPERTS_LAG_BOUND * self->bound) : 0.0;
    }
}

/* Squares first ... last - 1 of the recursion's impulse response. */
static void expert_respond(hsep_expert *self, hsep_int first, hsep_int last)
{
    const hsep_int n = self->n;
    const hsep_real *lag_weights = hsep_expert_weights(self) + self->n_static;
    hsep_real *response = hsep_at(self, self->response), *squares = hsep_at(self, self->squares);
    for (hsep_int k = first; k < last; k++) {
        const hsep_int j = n - 1 - k;
        response[j] = hsep_recur(k == 0 ? 1.0 : 0.0, lag_weights, response + j + 1, self->p);
        const hsep_real within =
            isnan(response[j]) ? HSEP_EXPERTS_DIVERGED : hsep_clip(response[j], HSEP_EXPERTS_DIVERGED);
        squares[k] = within * within;
    }
}

/* Variances of rows of samples k ... last - 1, of the first of every stride, at most HSEP_SOLUTION_ABREAST of them. */
static void expert_vary_rows(hsep_expert *self, const hsep_real rows[], hsep_int k, hsep_int last, hsep_int stride)
{
    const hsep_int n_static = self->n_static, p = self->p;
    const hsep_int count = hsep_min((last - k + stride - 1) / stride, HSEP_SOLUTION_ABREAST);
    hsep_solution *solution = hsep_expert_solution(self);
    hsep_real *to = hsep_at(solution, solution->work), leverages[HSEP_SOLUTION_ABREAST];
    for (hsep_int c = 0; c < count; c++, to += p + n_static + 1) {
        const hsep_int sample = k + stride * c;
        const hsep_real *lags = hsep_at(self, self->unshrunk) + (self->n - sample);
        for (hsep_int i = 0; i < p; i++) {
            to[p - 1 - i] = lags[i];
        }
        hsep_copy(to + p, rows + sample * n_static, n_static);
    }
    hsep_solution_leverages(solution, count, leverages);
    for (hsep_int c = 0; c < stride * count && k + c < last; c++) {
        hsep_at(self, self->variances)[self->n - 1 - k - c] = self->variance * leverages[c / stride];
    }
}

/* Variances of samples, the rows' carried through the impulse response, and what they leave of a prediction. */
static void expert_vary(hsep_expert *self, const hsep_real rows[], hsep_int first, hsep_int last, hsep_int stride)
{
    const hsep_real most = HSEP_EXPERTS_DIVERGED * self->bound * self->bound;
    const hsep_real *run = hsep_at(self, self->run), *squares = hsep_at(self, self->squares);
    hsep_real *shrinkage = hsep_at(self, self->shrinkage);
    if (self->p > 0) {
        expert_respond(self, first, last);
    }
    for (hsep_int k = first; k < last; k += stride * HSEP_SOLUTION_ABREAST) {
        expert_vary_rows(self, rows, k, last, stride);
    }
    for (hsep_int k = first; k < last; k++) {
        const hsep_int j = self->n - 1 - k;
        const hsep_real *variances = hsep_at(self, self->variances) + j;
        const hsep_real carried = self->p > 0 ? hsep_dot(squares, variances, k + 1) : variances[0];
        const hsep_real variance = isfinite(run[j]) && carried < most ? carried : most;
        shrinkage[j] = self->largest_square / (self->largest_square + variance);
    }
}

HSEP_API void hsep_expert_begin(hsep_expert *self, const hsep_real past[], hsep_real largest_square, hsep_real bound)
{
    self->largest_square = largest_square;
    self->bound = bound;
    hsep_copy(hsep_at(self, self->run) + self->n, past, self->p);
    hsep_copy(hsep_at(self, self->unshrunk) + self->n, past, self->p);
}

HSEP_API void hsep_expert_predict(
    hsep_expert *self, const hsep_real rows[], hsep_int first, hsep_int last, hsep_int stride)
{
    expert_free_run(self, rows, first, last);
    if (stride > 0) {
        expert_vary(self, rows, first, last, stride);
    }
    const hsep_real *unshrunk = hsep_at(self, self->unshrunk), *shrinkage = hsep_at(self, self->shrinkage);
    for (hsep_int j = self->n - last; j < self->n - first; j++) {
        hsep_at(self, self->e_h)[j] = hsep_clip(unshrunk[j], self->bound) * shrinkage[j];
    }
}

HSEP_API void hsep_expert_judge(
    const hsep_expert *self, hsep_expert_errors *errors, const hsep_real measured[], const hsep_real accepted[],
    hsep_int n, hsep_real given)
{
    const hsep_real *unshrunk = hsep_at_const(self, self->unshrunk) + (self->n - self->Np); /* of the window */
    hsep_real sum = 0.0, count = 0.0;
    for (hsep_int j = self->Np - n; j < self->Np; j++) {
        sum += accepted[j] * (measured[j] - unshrunk[j]);
        count += accepted[j];
    }
    errors->noise_variance = given > 0.0 ? given : self->rows_variance;
    if (errors->noise_variance > 0.0) {
        const hsep_real seen = hsep_fmin(sum * sum / count / errors->noise_variance, HSEP_EXPERTS_DIVERGED);
        errors->correlation += HSEP_AVERAGING_CORRELATION_RATE * (seen - errors->correlation);
        errors->correlation = hsep_fmin(hsep_fmax(errors->correlation, 1.0), HSEP_AVERAGING_CORRELATION_MAX);
    }
}

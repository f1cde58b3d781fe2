/* Memory of a run for recall: what the physics model missed the last time that it got the same commands; as
 * predict/averaging/recall.py, which says how stretches are compared.
 *
 * Commands come one by one, and all lags are compared in the samples of a stride: even work. Rings, newest first.
 */
#ifndef HSEP_RECALL_H
#define HSEP_RECALL_H

#include "hsep_layout.h"
#include "hsep_window.h"
#include "hsep_physics.h"
#include "hsep_predict_constants.h"

typedef struct {
    hsep_int size;       /* samples; 0: none */
    hsep_int stride;     /* samples that a change is over, and from one comparison to the next */
    hsep_int Np;         /* samples of a window */
    hsep_int n;          /* samples of a prediction: from the last residual to the last command */
    hsep_real fading;    /* of a sum from one comparison to the next */
    hsep_real same;      /* distance, relative to moved, below which the shortest lag is taken: under a compensator */
    hsep_real moved;     /* m2, sum of the squares of the changes */
    hsep_int heard;      /* commands of this window that came */
    hsep_int oldest;     /* place of the command a stride ago, */
    hsep_int newest;     /* of the last change, */
    hsep_int compared;   /* of the one that is compared, */
    hsep_int lag;        /* with the least distance, of those that were compared with it */
    hsep_int remembered; /* and of the last residual */
    hsep_int commands;   /* (stride,) m, the last ones, ring */
    hsep_int changes;    /* (size + stride,) m, ring: older ones are overwritten while these are compared */
    hsep_int residuals;  /* (size,) m, ring */
    /* Under a compensator, rings, too: */
    hsep_int repeats;    /* (size,) how often each came before, as far as it was alike, */
    hsep_int late;       /* (size,) m, commands of the drive, as late as HSEP_ARX_COMMAND takes them, */
    hsep_int leads;      /* (size,) m, and what they are before x_pb */
    hsep_int distances;  /* (size,) m2, of the lags 1 ... size */
    hsep_int found;      /* lag that the window is recalled with, */
    hsep_real alike;     /* and how much that counts */
    hsep_int p;          /* lags of HSEP_ARX_COMMAND, */
    hsep_int run_in;     /* and samples before it in which its answer to other commands is run in */
    hsep_real own;       /* m2, how fast the physics model answers to a pulse, */
    hsep_real moves;     /* and share of HSEP_ARX_COMMAND's, if it is faster, in what is recalled */
    hsep_real offset;    /* m, by which it is moved to the last residual, which fades */
    hsep_int fade;       /* (n,) share of that which is left */
    hsep_int then;       /* (n,) m, residuals that are recalled */
    hsep_int increments; /* (n + run_in + p,) m, of the commands, less those then, newest first, */
    hsep_int run;        /* (n + run_in + p,) m, and the answer to them */
    hsep_int physics;    /* G_pb */
} hsep_recall;
HSEP_ASSERT_WORDS(hsep_recall, 32);

static inline hsep_real hsep_recall_lay_out(hsep_recall *self, const hsep_predictor_parameters *parameters)
{
    hsep_real end = HSEP_WORDS(hsep_recall);
    self->size = parameters->averaging.recall;
    self->Np = parameters->settings.Np;
    self->n = self->lag = hsep_predicted(parameters);
    self->stride = self->Np > HSEP_RECALL_UPDATES ? self->Np / HSEP_RECALL_UPDATES : 1;
    self->fading = hsep_exp(-(hsep_real)self->stride / (hsep_real)self->n);
    self->same = parameters->compensates ? HSEP_RECALL_SAME : 0.0;
    self->commands = hsep_take(&end, (hsep_real)self->stride);
    self->changes = hsep_take(&end, (hsep_real)(self->size + self->stride));
    self->residuals = hsep_take(&end, (hsep_real)self->size);
    const hsep_real n = (hsep_real)self->n, kept = self->same > 0.0 ? (hsep_real)self->size : 0.0;
    self->repeats = hsep_take(&end, kept);
    self->late = hsep_take(&end, kept);
    self->leads = hsep_take(&end, kept);
    self->p = HSEP_AVERAGING_LAGS_OF_COMMAND;
    self->run_in = self->same > 0.0 ? self->n / 2 : 0;
    const hsep_real run = n + (hsep_real)(self->run_in + self->p);
    self->fade = hsep_take(&end, n);
    self->then = hsep_take(&end, n);
    self->increments = hsep_take(&end, run);
    self->run = hsep_take(&end, run);
    self->physics = hsep_take_block(&end, hsep_physics_lay_out(&(hsep_physics){0}, parameters));
    self->distances = hsep_take(&end, (hsep_real)self->size);
    return end * sizeof(hsep_real);
}

/* distance := fading distance + difference^2 of a change now from count changes before it. */
static inline void recall_add(
    hsep_real *restrict distances, const hsep_real *restrict changes, hsep_int count, hsep_real now, hsep_real fading)
{
    const hsep_int whole = count - count % HSEP_LANES;
    const hsep_real alike = HSEP_RECALL_ALIKE;
    hsep_int i = 0;
    for (; i < whole; i += HSEP_LANES) {
        hsep_lanes *to = hsep_lanes_at(distances + i);
        const hsep_lanes difference = now - *hsep_lanes_const(changes + i);
        *to = fading * *to + (difference * difference + alike);
    }
    for (; i < count; i++) {
        const hsep_real difference = now - changes[i];
        distances[i] = fading * distances[i] + (difference * difference + alike);
    }
}

/* Compare the latched change with those first ... last - 1 samples before it; in the last comparison of a window, which
 * its forecast has, look for the lag with the least distance. */
static inline void recall_compare(hsep_recall *self, hsep_int first, hsep_int last, int is_last)
{
    const hsep_int length = self->size + self->stride;
    const hsep_real *changes = hsep_at(self, self->changes), now = changes[self->compared];
    hsep_real *distances = hsep_at(self, self->distances);
    for (hsep_int begin = first; begin < last;) { /* up to the end of the ring, and from its beginning on */
        const hsep_int place = (self->compared + begin) % length, count = hsep_min(last - begin, length - place);
        recall_add(distances + (begin - 1), changes + place, count, now, self->fading);
        begin += count;
    }
    const hsep_int before = self->same > 0.0 ? self->run_in + self->p : 0;
    const hsep_int begin = first > self->n ? first - 1 : self->n, end = hsep_min(last, self->size - before) - 1;
    if (is_last && begin < end && distances[self->lag - 1] > self->same * self->moved) { /* the shortest of equals */
        const hsep_int found = begin + hsep_place_of_least(distances + begin, end - begin, self->same * self->moved);
        self->lag = distances[found] < distances[self->lag - 1] ? found + 1 : self->lag;
    }
}

/* Take in the command that comes next, m, relative to the start. Cost: size / stride multiply-adds. */
static inline void hsep_recall_append_command(hsep_recall *self, hsep_real command)
{
    const hsep_int part = self->heard % self->stride, size = self->size;
    hsep_real *before = hsep_at(self, self->commands) + self->oldest;
    if (size == 0) {
        return;
    }
    self->newest = (self->newest > 0 ? self->newest : size + self->stride) - 1;
    hsep_at(self, self->changes)[self->newest] = command - *before;
    *before = command;
    self->oldest = self->oldest + 1 < self->stride ? self->oldest + 1 : 0;
    const hsep_int compared = self->Np / self->stride * self->stride;
    if (self->heard < compared) {
        if (part == 0) {
            const hsep_real change = hsep_at(self, self->changes)[self->newest];
            self->compared = self->newest;
            self->lag = self->n;
            self->moved = self->fading * self->moved + (change * change + HSEP_RECALL_ALIKE);
        }
        recall_compare(
            self, 1 + part * size / self->stride, 1 + (part + 1) * size / self->stride,
            self->heard + self->stride >= compared);
    }
    self->heard = self->heard + 1 < self->Np ? self->heard + 1 : 0;
}

/* Take in residuals of the window, (Np,), m, newest first: the model's, and of the command as late as late. Behind a
 * compensator a part that came some times is remembered as a mean, which fades. */
static inline void hsep_recall_remember(
    hsep_recall *self, const hsep_real e[], const hsep_real e_0[], const hsep_real late[])
{
    hsep_real *residuals = hsep_at(self, self->residuals), *repeats = hsep_at(self, self->repeats);
    hsep_real *lates = hsep_at(self, self->late), *leads = hsep_at(self, self->leads);
    for (hsep_int j = self->size > 0 ? self->Np : 0; j-- > 0;) {
        self->remembered = (self->remembered > 0 ? self->remembered : self->size) - 1;
        hsep_real kept = 0.0;
        const hsep_int then = (self->remembered + self->found) % self->size;
        if (self->same > 0.0) {
            const hsep_real count = repeats[self->remembered] = self->alike * (repeats[then] + 1.0);
            kept = count < HSEP_AVERAGING_RECALL_REPEATS ? 0.0 : (1.0 - HSEP_AVERAGING_RECALL_SHARE) * self->alike;
            lates[self->remembered] = late[j] + kept * (lates[then] - late[j]);
            leads[self->remembered] = (e[j] - e_0[j]) + kept * (leads[then] - (e[j] - e_0[j]));
        }
        residuals[self->remembered] = e[j] + kept * (residuals[then] - e[j]);
    }
}

/* Answer of HSEP_ARX_COMMAND at place j to the increments up to there. weights: of increments and of lags. */
static inline void recall_answer(hsep_recall *self, const hsep_real weights[], hsep_int j)
{
    const hsep_int p = self->p;
    hsep_real *run = hsep_at(self, self->run);
    const hsep_real drive = hsep_dot(weights, hsep_at(self, self->increments) + j, p + 1);
    run[j] = hsep_recur(drive, weights + p + 1, run + j + 1, p);
}

static inline hsep_real recall_within(const hsep_recall *self, hsep_int j, hsep_real most)
{
    const hsep_real answer = hsep_at_const(self, self->run)[j];
    return isfinite(answer) ? hsep_clip(answer, most) : 0.0;
}

/* Change of a command that the physics model's answer and HSEP_ARX_COMMAND's are compared by, at a sample. */
static inline hsep_real recall_pulse(hsep_int k)
{
    const hsep_real u = (hsep_real)(k + 1) / HSEP_RECALL_PULSE;
    return u < 1.0 ? (u * (1.0 - u)) * (u * (1.0 - u)) * (u * (1.0 - u)) : 0.0;
}

/* Sum of the squares of the second differences of an answer, m2, as its samples x come. */
typedef struct {
    hsep_real before, step, sum;
    hsep_int count;
} recall_speed;
static inline void recall_follow(recall_speed *self, hsep_real x)
{
    const hsep_real step = x - self->before, change = step - self->step;
    self->sum += self->count++ > 1 ? change * change : 0.0;
    self->step = step;
    self->before = x;
}

/* The same of HSEP_ARX_COMMAND's answer to the pulse. */
static inline hsep_real recall_square(hsep_recall *self, const hsep_real weights[])
{
    const hsep_int n = self->n, p = self->p;
    recall_speed speed = {0};
    hsep_zero(hsep_at(self, self->increments) + n, p);
    hsep_zero(hsep_at(self, self->run) + n, p);
    for (hsep_int k = 0; k < n; k++) {
        const hsep_real before = k > 0 ? recall_pulse(k - 1) : 0.0;
        hsep_at(self, self->increments)[n - 1 - k] = recall_pulse(k) - before;
        recall_answer(self, weights, n - 1 - k);
        recall_follow(&speed, recall_pulse(k) + hsep_at(self, self->run)[n - 1 - k]);
    }
    return speed.sum;
}

/* Fill the block, which is 0, at rest. */
static inline void hsep_recall_init(hsep_recall *self, const hsep_predictor_parameters *parameters)
{
    recall_speed speed = {0};
    (void)hsep_recall_lay_out(self, parameters);
    hsep_physics *physics = hsep_part(self, self->physics);
    hsep_physics_init(physics, parameters);
    for (hsep_int k = 0; k < self->n; k++) {
        recall_follow(&speed, hsep_physics_respond(physics, recall_pulse(k)));
    }
    self->own = speed.sum;
}

/* Place of the sample that is places before the last residual, and that of the one recalled for it. */
static inline hsep_int recall_now(const hsep_recall *self, hsep_int places)
{
    return (self->remembered + places) % self->size;
}
static inline hsep_int recall_then(const hsep_recall *self, hsep_int places)
{
    return (self->remembered + self->found + places) % self->size;
}

/* Begin a window: residuals after the commands most like those ahead, and how much they count, 0 ... 1; 0 if the memory
 * is shorter. last: m, the last residual; weights: of HSEP_ARX_COMMAND, its increments' and its lags', NULL without. */
static inline hsep_real hsep_recall_begin(hsep_recall *self, hsep_real last, const hsep_real weights[])
{
    const hsep_real *residuals = hsep_at_const(self, self->residuals), *late = hsep_at_const(self, self->late);
    const hsep_real *leads = hsep_at_const(self, self->leads);
    const hsep_real tolerated = HSEP_AVERAGING_RECALL_TOLERANCE * HSEP_AVERAGING_RECALL_TOLERANCE * self->moved;
    const hsep_int n = self->n, p = self->p, before = self->run_in;
    hsep_real *then = hsep_at(self, self->then), *fade = hsep_at(self, self->fade);
    hsep_real *run = hsep_at(self, self->run), *increments = hsep_at(self, self->increments);
    hsep_zero(then, n);
    self->moves = self->offset = 0.0;
    if (self->size < n + (self->same > 0.0 ? before + p + 1 : 1)) {
        return self->alike = 0.0;
    }
    self->found = self->lag;
    for (hsep_int j = 0; j < n; j++) {
        fade[j] = hsep_exp(-(hsep_real)(n - j) / (HSEP_AVERAGING_RECALL_FADE * (hsep_real)self->Np));
        then[j] = residuals[recall_then(self, j - n)];
    }
    self->offset = last - residuals[recall_then(self, 0)];
    const hsep_real distance = hsep_at_const(self, self->distances)[self->lag - 1];
    self->alike = distance > 0.0 ? tolerated / (tolerated + distance) : 0.0;
    if (weights != NULL && self->alike > 0.0) {
        const hsep_real square = recall_square(self, weights);
        self->moves = self->own < square && square < INFINITY ? 1.0 - self->own / square : 0.0;
        /* as far as the path is the same, so that commands differ by what was planned */
        self->moves *= self->same * self->moved / hsep_fmax(distance, self->same * self->moved);
    }
    if (self->moves > 0.0) {
        for (hsep_int i = 0; i < before + p; i++) {
            increments[n + i] = (late[recall_now(self, i)] - late[recall_now(self, i + 1)]) -
                                (late[recall_then(self, i)] - late[recall_then(self, i + 1)]);
        }
        for (hsep_int i = before; i < before + p; i++) {
            const hsep_int now = recall_now(self, i), other = recall_then(self, i);
            run[n + i] = (residuals[now] - leads[now]) - (residuals[other] - leads[other]);
        }
        for (hsep_int i = before; i-- > 0;) {
            recall_answer(self, weights, n + i);
        }
    }
    return self->alike;
}

/* What is recalled for samples first ... last - 1, m, newest first. late, x_pb: (n,) m, commands as above, and the
 * physics model's response; bound, most: m, on what is recalled, and on the answer to other commands. */
static inline void hsep_recall_predict(
    hsep_recall *self, const hsep_real weights[], const hsep_real late[], const hsep_real x_pb[], hsep_real bound,
    hsep_real most, hsep_int first, hsep_int last, hsep_real recalled[])
{
    const hsep_int n = self->n;
    const hsep_real *then = hsep_at_const(self, self->then), *fade = hsep_at_const(self, self->fade);
    const hsep_real *lates = hsep_at_const(self, self->late), *leads = hsep_at_const(self, self->leads);
    hsep_real offset = self->offset, *increments = hsep_at(self, self->increments);
    if (self->moves > 0.0) {
        const hsep_real before = leads[recall_now(self, 0)] - leads[recall_then(self, 0)];
        offset -= self->moves * (before + recall_within(self, n, most));
    }
    for (hsep_int k = first; k < last; k++) {
        const hsep_int j = n - 1 - k;
        hsep_real change = 0.0;
        if (self->moves > 0.0) {
            const hsep_int other = recall_then(self, j - n);
            const hsep_real step = j + 1 < n ? late[j + 1] : lates[recall_now(self, 0)];
            increments[j] = (late[j] - step) - (lates[other] - lates[recall_then(self, j - n + 1)]);
            recall_answer(self, weights, j);
            change = self->moves * ((late[j] - x_pb[j]) - leads[other] + recall_within(self, j, most));
        }
        recalled[j] = hsep_clip(then[j] + change + offset * fade[j], bound);
    }
}

#endif

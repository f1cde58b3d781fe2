/* Memory of a run for recall: what the physics model missed the last time that it got the same commands; as
 * predict/averaging/recall.py, which says how stretches are compared.
 *
 * Commands come one by one, and all lags are compared in the samples of a stride: even work. Rings, newest first.
 */
#ifndef HSEP_RECALL_H
#define HSEP_RECALL_H

#include "hsep_layout.h"
#include "hsep_window.h"
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
    hsep_int repeats;    /* (size,) how often each came before, as far as it was alike, ring; under a compensator */
    hsep_int distances;  /* (size,) m2, of the lags 1 ... size */
    hsep_int found;      /* lag that the window is recalled with, */
    hsep_real alike;     /* and how much that counts */
} hsep_recall;
HSEP_ASSERT_WORDS(hsep_recall, 20);

/* It is all that a block of 0 needs to be at rest. */
static inline hsep_real hsep_recall_lay_out(hsep_recall *self, const hsep_predictor_parameters *parameters)
{
    hsep_real end = HSEP_WORDS(hsep_recall);
    self->size = parameters->averaging.recall;
    self->Np = parameters->settings.Np;
    self->n = self->lag = hsep_predicted(parameters);
    self->stride = self->Np > HSEP_RECALL_UPDATES ? self->Np / HSEP_RECALL_UPDATES : 1;
    self->fading = hsep_exp(-(hsep_real)self->stride / (hsep_real)self->n);
    self->same = parameters->planned ? HSEP_RECALL_SAME : 0.0;
    self->commands = hsep_take(&end, (hsep_real)self->stride);
    self->changes = hsep_take(&end, (hsep_real)(self->size + self->stride));
    self->residuals = hsep_take(&end, (hsep_real)self->size);
    self->repeats = hsep_take(&end, self->same > 0.0 ? (hsep_real)self->size : 0.0);
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
    const hsep_int begin = first > self->n ? first - 1 : self->n, end = hsep_min(last, self->size) - 1;
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

/* Take in the residuals of the window, (Np,), m, newest first. Behind a compensator a part that came some times is
 * remembered as a mean, which fades. */
static inline void hsep_recall_remember(hsep_recall *self, const hsep_real e[])
{
    hsep_real *residuals = hsep_at(self, self->residuals), *repeats = hsep_at(self, self->repeats);
    for (hsep_int j = self->size > 0 ? self->Np : 0; j-- > 0;) {
        self->remembered = (self->remembered > 0 ? self->remembered : self->size) - 1;
        hsep_real kept = 0.0;
        const hsep_int then = (self->remembered + self->found) % self->size;
        if (self->same > 0.0) {
            const hsep_real count = repeats[self->remembered] = self->alike * (repeats[then] + 1.0);
            kept = count < HSEP_AVERAGING_RECALL_REPEATS ? 0.0 : (1.0 - HSEP_AVERAGING_RECALL_SHARE) * self->alike;
        }
        residuals[self->remembered] = e[j] + kept * (residuals[then] - e[j]);
    }
}

/* Residuals after the commands most like those ahead, (n,), m, newest first, moved to the last one, which fades. Return
 * how much they count, 0 ... 1; 0 if the memory is shorter. */
static inline hsep_real hsep_recall_forecast(hsep_recall *self, hsep_real last, hsep_real recalled[])
{
    const hsep_real *residuals = hsep_at_const(self, self->residuals);
    const hsep_real tolerated = HSEP_AVERAGING_RECALL_TOLERANCE * HSEP_AVERAGING_RECALL_TOLERANCE * self->moved;
    const hsep_int n = self->n, lag = self->lag;
    hsep_zero(recalled, n);
    if (self->size <= self->n) {
        return 0.0;
    }
    for (hsep_int k = 0; k < n; k++) {
        const hsep_real before = residuals[(self->remembered + lag) % self->size];
        const hsep_real fade = hsep_exp(-(hsep_real)(k + 1) / (HSEP_AVERAGING_RECALL_FADE * (hsep_real)self->Np));
        recalled[n - 1 - k] = residuals[(self->remembered + lag - 1 - k) % self->size] + (last - before) * fade;
    }
    const hsep_real distance = hsep_at_const(self, self->distances)[lag - 1];
    self->found = lag;
    self->alike = distance > 0.0 ? tolerated / (tolerated + distance) : 0.0;
    return self->alike;
}

#endif

#include "hsep_recall.h"

#include "hsep_math.h"
#include "hsep_predict_constants.h"

#include <string.h>

HSEP_API hsep_real hsep_recall_lay_out(hsep_recall *self, const hsep_residual_parameters *parameters)
{
    const hsep_real size = (hsep_real)parameters->averaging->recall;
    hsep_real end = HSEP_WORDS(hsep_recall);
    self->size = parameters->averaging->recall;
    self->Np = parameters->settings->Np;
    self->n = self->lag = parameters->n;
    self->stride = self->Np > HSEP_RECALL_UPDATES ? self->Np / HSEP_RECALL_UPDATES : 1;
    self->fading = hsep_exp(-(hsep_real)self->stride / (hsep_real)self->Np);
    self->commands = hsep_take(&end, (hsep_real)self->stride);
    self->changes = hsep_take(&end, size + (hsep_real)self->stride);
    self->residuals = hsep_take(&end, size);
    self->distances = hsep_take(&end, size);
    return end * sizeof(hsep_real);
}

/* Compare the latched change with those first ... last - 1 samples before it. */
static void recall_compare(hsep_recall *self, hsep_int first, hsep_int last)
{
    const hsep_int length = self->size + self->stride, begin = first;
    const hsep_real *changes = hsep_at(self, self->changes), now = changes[self->compared], fading = self->fading;
    hsep_real *distances = hsep_at(self, self->distances);
    while (first < last) { /* up to the end of the ring, and from its beginning on */
        const hsep_int place = (self->compared + first) % length, left = length - place;
        const hsep_int count = last - first < left ? last - first : left;
        for (hsep_int i = 0; i < count; i++) {
            const hsep_real difference = now - changes[place + i];
            distances[first - 1 + i] =
                fading * distances[first - 1 + i] + (difference * difference + HSEP_RECALL_ALIKE);
        }
        first += count;
    }
    for (hsep_int i = begin > self->n ? begin : self->n + 1; i < last && i < self->size; i++) {
        self->lag = distances[i - 1] < distances[self->lag - 1] ? i : self->lag; /* the shortest one of equals */
    }
}

HSEP_API void hsep_recall_append_command(hsep_recall *self, hsep_real command)
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
    if (self->heard < self->Np / self->stride * self->stride) {
        if (part == 0) {
            const hsep_real change = hsep_at(self, self->changes)[self->newest];
            self->compared = self->newest;
            self->lag = self->n;
            self->moved = self->fading * self->moved + (change * change + HSEP_RECALL_ALIKE);
        }
        recall_compare(self, 1 + part * size / self->stride, 1 + (part + 1) * size / self->stride);
    }
    self->heard = self->heard + 1 < self->Np ? self->heard + 1 : 0;
}

HSEP_API void hsep_recall_remember(hsep_recall *self, const hsep_real e[])
{
    for (hsep_int j = self->size > 0 ? self->Np : 0; j-- > 0;) {
        self->remembered = (self->remembered > 0 ? self->remembered : self->size) - 1;
        hsep_at(self, self->residuals)[self->remembered] = e[j];
    }
}

HSEP_API hsep_real hsep_recall_forecast(const hsep_recall *self, hsep_real last, hsep_real recalled[])
{
    const hsep_real *residuals = hsep_at_const(self, self->residuals);
    const hsep_real tolerated = HSEP_AVERAGING_RECALL_TOLERANCE * HSEP_AVERAGING_RECALL_TOLERANCE * self->moved;
    const hsep_int n = self->n, lag = self->lag;
    memset(recalled, 0, (size_t)n * sizeof(hsep_real));
    if (self->size <= self->n) {
        return 0.0;
    }
    for (hsep_int k = 0; k < n; k++) {
        const hsep_real before = residuals[(self->remembered + lag) % self->size];
        const hsep_real fade = hsep_exp(-(hsep_real)(k + 1) / (HSEP_AVERAGING_RECALL_FADE * (hsep_real)self->Np));
        recalled[n - 1 - k] = residuals[(self->remembered + lag - 1 - k) % self->size] + (last - before) * fade;
    }
    const hsep_real distance = hsep_at_const(self, self->distances)[lag - 1];
    return distance > 0.0 ? tolerated / (tolerated + distance) : 0.0;
}

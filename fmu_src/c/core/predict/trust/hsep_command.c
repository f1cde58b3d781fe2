#include "hsep_command.h"

#include "hsep_trust_constants.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* Set what follows from the parameters; return the bytes of the block. */
static double command_lay_out(hsep_command *self, const hsep_predictor_settings *settings, uint64_t n)
{
    double end = HSEP_WORDS(hsep_command);
    self->n = n;
    self->dead_time = settings->dead_time;
    self->p = HSEP_TRUST_LAGS_OF_COMMAND;
    self->count = self->p + 2;
    self->n_before = settings->dead_time + self->p + 1;
    self->commands = hsep_take(&end, (double)n + (double)settings->dead_time + (double)self->p + 1.0);
    self->rows = hsep_take(&end, (double)n * (double)self->count);
    self->shares = hsep_take(&end, (double)self->count);
    return end * sizeof(double);
}

HSEP_API double hsep_command_size(const hsep_predictor_settings *settings, uint64_t n)
{
    return command_lay_out(&(hsep_command){0}, settings, n);
}

HSEP_API void hsep_command_init(hsep_command *self, const hsep_predictor_settings *settings, uint64_t n)
{
    memset(self, 0, (size_t)hsep_command_size(settings, n));
    (void)command_lay_out(self, settings, n);
    for (uint64_t i = 0; i < self->count; i++) {
        const double age = i > 0 ? (double)(i - 1) / (double)self->p : 0.0;
        hsep_at(self, self->shares)[i] = sqrt(pow(HSEP_TRUST_LAST_LAG, age));
    }
}

HSEP_API int hsep_command_valid(const void *block, const hsep_predictor_settings *settings, uint64_t n)
{
    hsep_command got;
    memcpy(&got, block, sizeof got);
    (void)command_lay_out(&got, settings, n); /* changes nothing where it is sound */
    return memcmp(&got, block, sizeof got) == 0;
}

HSEP_API double hsep_command_share(const hsep_command *self, uint64_t feature)
{
    return hsep_at_const(self, self->shares)[feature];
}

HSEP_API void hsep_command_take(hsep_command *self, const double x_d[], uint64_t m)
{
    hsep_command_take_in(self, x_d, m);
    hsep_command_fill(self, m, 0, m);
}

HSEP_API void hsep_command_take_in(hsep_command *self, const double x_d[], uint64_t m)
{
    memcpy(hsep_at(self, self->commands) + (self->n - m), x_d, (size_t)m * sizeof(double));
}

HSEP_API void hsep_command_fill(hsep_command *self, uint64_t m, uint64_t first, uint64_t last)
{
    const double *commands = hsep_at(self, self->commands) + (self->n - m);
    double *row = hsep_at(self, self->rows) + first * self->count;
    for (uint64_t k = first; k < last; k++, row += self->count) {
        const double *late = commands + (m - 1 - k) + self->dead_time;
        row[0] = 1.0;
        for (uint64_t i = 1; i < self->count; i++) {
            row[i] = late[i - 1] - late[i];
        }
    }
}

HSEP_API const double *hsep_command_late(const hsep_command *self, uint64_t m)
{
    return hsep_at_const(self, self->commands) + (self->n - m) + self->dead_time;
}

HSEP_API void hsep_command_end(hsep_command *self, uint64_t m)
{
    double *before = hsep_at(self, self->commands) + self->n;
    memmove(before, before - m, (size_t)self->n_before * sizeof(double));
}

HSEP_API void hsep_command_begin(hsep_command *self, double first, double second)
{
    double *before = hsep_at(self, self->commands) + self->n;
    for (uint64_t i = 0; i < self->n_before; i++) {
        before[i] = first - (second - first) * (double)(i + 1);
    }
}

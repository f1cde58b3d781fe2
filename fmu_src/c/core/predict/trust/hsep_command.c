#include "hsep_command.h"

#include "hsep_math.h"
#include "hsep_predict_constants.h"

#include <stddef.h>
#include <string.h>

/* Set what follows from the parameters; return the bytes of the block. */
static hsep_real command_lay_out(hsep_command *self, const hsep_residual_parameters *parameters)
{
    const hsep_predictor_settings *settings = parameters->settings;
    const hsep_word n = parameters->n;
    hsep_real end = HSEP_WORDS(hsep_command);
    self->n = n;
    self->dead_time = settings->dead_time;
    self->p = HSEP_TRUST_LAGS_OF_COMMAND;
    self->count = self->p + 2;
    self->n_before = settings->dead_time + self->p + 1;
    self->commands = hsep_take(&end, (hsep_real)n + (hsep_real)settings->dead_time + (hsep_real)self->p + 1.0);
    self->rows = hsep_take(&end, (hsep_real)n * (hsep_real)self->count);
    self->shares = hsep_take(&end, (hsep_real)self->count);
    return end * sizeof(hsep_real);
}

HSEP_API hsep_real hsep_command_size(const hsep_residual_parameters *parameters)
{
    return command_lay_out(&(hsep_command){0}, parameters);
}

HSEP_API void hsep_command_init(hsep_command *self, const hsep_residual_parameters *parameters)
{
    memset(self, 0, (size_t)hsep_command_size(parameters));
    (void)command_lay_out(self, parameters);
    for (hsep_word i = 0; i < self->count; i++) {
        const hsep_real age = i > 0 ? (hsep_real)(i - 1) / (hsep_real)self->p : 0.0;
        hsep_at(self, self->shares)[i] = hsep_sqrt(hsep_pow(HSEP_TRUST_LAST_LAG, age));
    }
}

HSEP_API int hsep_command_valid(const void *block, const hsep_residual_parameters *parameters)
{
    hsep_command got;
    return HSEP_LAID_OUT(got, block, command_lay_out(&got, parameters));
}

HSEP_API hsep_real hsep_command_share(const hsep_command *self, hsep_word feature)
{
    return hsep_at_const(self, self->shares)[feature];
}

HSEP_API void hsep_command_take(hsep_command *self, const hsep_real x_d[], hsep_word m)
{
    memcpy(hsep_at(self, self->commands) + (self->n - m), x_d, (size_t)m * sizeof(hsep_real));
}

HSEP_API void hsep_command_fill(hsep_command *self, hsep_word m, hsep_word first, hsep_word last)
{
    const hsep_real *commands = hsep_at(self, self->commands) + (self->n - m);
    hsep_real *row = hsep_at(self, self->rows) + first * self->count;
    for (hsep_word k = first; k < last; k++, row += self->count) {
        const hsep_real *late = commands + (m - 1 - k) + self->dead_time;
        row[0] = 1.0;
        for (hsep_word i = 1; i < self->count; i++) {
            row[i] = late[i - 1] - late[i];
        }
    }
}

HSEP_API const hsep_real *hsep_command_late(const hsep_command *self, hsep_word m)
{
    return hsep_at_const(self, self->commands) + (self->n - m) + self->dead_time;
}

HSEP_API void hsep_command_end(hsep_command *self, hsep_word m)
{
    hsep_real *before = hsep_at(self, self->commands) + self->n;
    memmove(before, before - m, (size_t)self->n_before * sizeof(hsep_real));
}

HSEP_API void hsep_command_begin_in_motion(hsep_command *self, hsep_real first, hsep_real second)
{
    hsep_real *before = hsep_at(self, self->commands) + self->n;
    for (hsep_word i = 0; i < self->n_before; i++) {
        before[i] = first - (second - first) * (hsep_real)(i + 1);
    }
}

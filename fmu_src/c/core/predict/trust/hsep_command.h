/* Features of the expert without a physics model, eq. (4) with G_pb = 1; as predict/trust/command.py.
 *
 * Positions are relative to the start. Of m samples that come next, sample k is at place m - 1 - k: newest first. A
 * block as hsep_layout.h has them.
 */
#ifndef HSEP_COMMAND_H
#define HSEP_COMMAND_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_real.h"
#include "hsep_residual_window.h"

typedef struct {
    hsep_word n;         /* samples of a prediction */
    hsep_word dead_time; /* samples */
    hsep_word p;         /* lags, and increments after the first, whatever p of the settings is */
    hsep_word count;     /* features without lags, p + 2 */
    hsep_word n_before;  /* commands before a window that its features need */
    /* Offsets in words from the beginning of the struct */
    hsep_word commands; /* (n + n_before,) m, of a prediction, newest first, and before it: its last m places if it has
                        * fewer samples */
    hsep_word rows;     /* (n, count) features, sample after sample */
    hsep_word shares;   /* (count,) effects that they may have, relative to the largest */
} hsep_command;

HSEP_ASSERT_WORDS(hsep_command, 8);

HSEP_API hsep_real hsep_command_size(const hsep_residual_parameters *parameters);
/* Fill the block, at rest. */
HSEP_API void hsep_command_init(hsep_command *self, const hsep_residual_parameters *parameters);
HSEP_API int hsep_command_valid(const void *block, const hsep_residual_parameters *parameters);

/* Effect that a feature may have, relative to the largest: an old increment explains less than a recent one. */
HSEP_API hsep_real hsep_command_share(const hsep_command *self, hsep_word feature);

/* Take in the commands of the m samples that come next, (m,), m, m <= n; may be tried again with others. */
HSEP_API void hsep_command_take(hsep_command *self, const hsep_real x_d[], hsep_word m);

/* Fill the rows of samples first ... last - 1 of these. */
HSEP_API void hsep_command_fill(hsep_command *self, hsep_word m, hsep_word first, hsep_word last);

/* Of these, the commands as many samples ago as the dead time has, (m,), m. */
HSEP_API const hsep_real *hsep_command_late(const hsep_command *self, hsep_word m);

/* End the window, which are the m samples taken in last. */
HSEP_API void hsep_command_end(hsep_command *self, hsep_word m);

/* Begin in motion: commands, m, went on as the first and the second of the first window. */
HSEP_API void hsep_command_begin_in_motion(hsep_command *self, hsep_real first, hsep_real second);

#endif

/* The table of an FMU's variables by place, which is the value reference. */
#ifndef HSEP_TABLE_H
#define HSEP_TABLE_H

#include "hsep_model.h"
#include "hsep_physics.h"

#define HSEP_NAME_SIZE 64 /* bytes of a name, the final 0 included */

/* Variables before the windows: those with a start value. */
HSEP_API size_t hsep_table_n_starts(const hsep_context *context);

/* The row of a variable: the numbers of all modes share one each, as the samples of a window do. */
HSEP_API const hsep_variable *hsep_table_row(const hsep_context *context, size_t place);

/* The name of a variable: the row's own string, or text, which is filled then (mode[1].f_n, x_h_window[1]). */
HSEP_API const char *hsep_table_name(const hsep_context *context, size_t place, char text[HSEP_NAME_SIZE]);

/* Place of the variable of a name; n_variables if there is none. */
HSEP_API size_t hsep_table_place(const hsep_context *context, const char *name);

/* The modes, (n_modes,), whose numbers lie in values. */
HSEP_API const hsep_mode *hsep_table_modes(const hsep_context *context, const double values[]);

#endif

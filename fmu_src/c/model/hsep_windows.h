/* What an adapter sees of a model with windows, HybridPredictor, besides hsep_model.h. */
#ifndef HSEP_WINDOWS_H
#define HSEP_WINDOWS_H

#include "hsep_fmu.h"

#if HSEP_N_WINDOWS > 0

/* Write the samples of all windows to values. Steps leave part of a prediction to the next ones: what is left of it is
 * done here. All later outputs are the same. Nothing is written if the window diverges. */
HSEP_API void hsep_model_show_windows(const hsep_context *context, void *state, double values[]);

#endif

#endif

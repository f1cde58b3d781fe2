/* What an adapter sees of a model with windows, HybridPredictor, besides hsep_model.h. */
#ifndef HSEP_WINDOWS_H
#define HSEP_WINDOWS_H

#include "hsep_fmu.h"

#if HSEP_N_WINDOWS > 0

/* Write the samples of all windows to values. Steps leave part of a prediction to the next ones: what is left of it is
 * done here. All later outputs are the same. Nothing is written if the window diverges. */
HSEP_API void hsep_model_show_windows(const hsep_context *context, void *state, double values[]);

/* Write the derivative of x_h in a direction of x_d_window, (Np,), m: of its window to x_h, (Np,), m, and of x_h itself
 * to now. work: (Np,). Fails with averaging, whose model is not linear in the commands. */
HSEP_API hsep_status
hsep_model_derivative(void *state, const double direction[], double x_h[], double *now, double work[], char message[]);

#endif

#endif

/* Memory of a run for recall: what the physics model missed the last time that the machine was told the same; as
 * predict/averaging/recall.py, which says how stretches are compared.
 *
 * Commands come one by one, and all lags are compared in the samples of a stride: even work. Rings, newest first. A
 * block as hsep_layout.h has them.
 */
#ifndef HSEP_RECALL_H
#define HSEP_RECALL_H

#include "hsep_layout.h"
#include "hsep_window.h"

typedef struct {
    hsep_int size;       /* samples; 0: none */
    hsep_int stride;     /* samples that a change is over, and from one comparison to the next */
    hsep_int Np;         /* samples of a window */
    hsep_int n;          /* samples of a prediction: from the last residual to the last command */
    hsep_real fading;    /* of a sum from one comparison to the next */
    hsep_real moved;     /* m2, sum of the squares of the changes */
    hsep_int heard;      /* commands of this window that came */
    hsep_int oldest;     /* place of the command a stride ago, */
    hsep_int newest;     /* of the last change, */
    hsep_int compared;   /* of the one that is compared, */
    hsep_int lag;        /* with the least distance, of those that were compared with it */
    hsep_int remembered; /* and of the last residual */
    /* Offsets in words from the beginning of the struct */
    hsep_int commands;  /* (stride,) m, the last ones, ring */
    hsep_int changes;   /* (size + stride,) m, ring: older ones are overwritten while these are compared */
    hsep_int residuals; /* (size,) m, ring */
    hsep_int distances; /* (size,) m2, of the lags 1 ... size */
} hsep_recall;
HSEP_ASSERT_WORDS(hsep_recall, 16);

/* It is all that a block of 0 needs to be at rest. */
HSEP_API hsep_real hsep_recall_lay_out(hsep_recall *self, const hsep_predictor_parameters *parameters);

/* Take in the command that comes next, m, relative to the start. Cost: size / stride multiply-adds. */
HSEP_API void hsep_recall_append_command(hsep_recall *self, hsep_real command);

/* Take in the residuals of the window, (Np,), m, newest first. */
HSEP_API void hsep_recall_remember(hsep_recall *self, const hsep_real e[]);

/* Residuals after the commands most like those ahead, (n,), m, newest first, moved to the last one, which fades. Return
 * how much they count, 0 ... 1; 0 if the memory is shorter. */
HSEP_API hsep_real hsep_recall_forecast(const hsep_recall *self, hsep_real last, hsep_real recalled[]);

#endif

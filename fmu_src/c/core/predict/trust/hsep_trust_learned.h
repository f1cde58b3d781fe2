/* Least and most of what the residual model with trust has learned, generated from
 * hybridsep/predict/trust/learned.py. */
#ifndef HSEP_TRUST_LEARNED_H
#define HSEP_TRUST_LEARNED_H

#define HSEP_LEARNED_N_ROWS 0.0, 1e+100
#define HSEP_LEARNED_MOTION 0.0, 1e+100
#define HSEP_LEARNED_SCALE 0.0, 1e+100
#define HSEP_LEARNED_SCALE_OF_COMMAND 0.0, 1e+100
#define HSEP_LEARNED_NOISE_VARIANCES 0.0, 1e+100
#define HSEP_LEARNED_CORRELATIONS 1.0, 1e+100
#define HSEP_LEARNED_LARGEST 0.0, 1e+100
#define HSEP_LEARNED_WEIGHTS 0.0, 1.0
#define HSEP_LEARNED_GRAM -1e+100, 1e+100
#define HSEP_LEARNED_CROSS -1e+100, 1e+100
#define HSEP_LEARNED_EVIDENCE 0.0, 1e+100

#endif

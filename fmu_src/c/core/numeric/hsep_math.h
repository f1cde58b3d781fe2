/* Functions of C's library for hsep_real: with HSEP_FLOAT32 the functions for float. */
#ifndef HSEP_MATH_H
#define HSEP_MATH_H

#include <math.h>

#ifdef HSEP_FLOAT32
#define HSEP_MATH(name) name##f
#else
#define HSEP_MATH(name) name
#endif

#define HSEP_TWO_PI 6.283185307179586

#define hsep_ceil HSEP_MATH(ceil)
#define hsep_cos HSEP_MATH(cos)
#define hsep_exp HSEP_MATH(exp)
#define hsep_fabs HSEP_MATH(fabs)
#define hsep_fmax HSEP_MATH(fmax)
#define hsep_fmin HSEP_MATH(fmin)
#define hsep_frexp HSEP_MATH(frexp)
#define hsep_ldexp HSEP_MATH(ldexp)
#define hsep_pow HSEP_MATH(pow)
#define hsep_sin HSEP_MATH(sin)
#define hsep_sqrt HSEP_MATH(sqrt)
#define hsep_tanh HSEP_MATH(tanh)

#endif

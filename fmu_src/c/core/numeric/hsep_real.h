/* Numbers of the library and whole numbers of the same size, so that a block has no padding.
 *
 * With HSEP_FLOAT32, defined for the library and for what includes hsep.h, numbers have 4 bytes, for processors that
 * compute only in single precision; README.md says what that costs. FMUs have 8.
 *
 * HSEP_EXACT: whole numbers below it are numbers without rounding. HSEP_TINY and HSEP_HUGE: a positive number beyond
 * the range of single precision, or there what stands for it. */
#ifndef HSEP_REAL_H
#define HSEP_REAL_H

#include <stdint.h>

#ifdef HSEP_FLOAT32
typedef float hsep_real;
typedef uint32_t hsep_int;
typedef int32_t hsep_signed;
#define HSEP_EXACT 16777216.0F
#define HSEP_TINY(number) 1e-36F
#define HSEP_HUGE(number) 1e15F
#else
typedef double hsep_real;
typedef uint64_t hsep_int;
typedef int64_t hsep_signed;
#define HSEP_EXACT 9007199254740992.0
#define HSEP_TINY(number) (number)
#define HSEP_HUGE(number) (number)
#endif

#endif

/* Linkage of the functions that source files share: HSEP_API stands at every declaration and definition of one.
 *
 * Files compiled one by one see each other's functions: external linkage. Where all.c includes every file, it defines
 * HSEP_API as static inline before: nothing but the FMI functions has external linkage then, and several FMUs can be
 * linked into one program. Inline, because a model uses some of the functions only, and compilers warn about unused
 * ones that are merely static.
 */
#ifndef HSEP_API_H
#define HSEP_API_H

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "hsep needs IEEE 754 arithmetic, NaN and the order of operations as written: no -ffast-math, no /fp:fast"
#endif

#ifndef HSEP_API
#define HSEP_API
#endif

#endif

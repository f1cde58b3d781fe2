/* Vectors of four doubles where the processor has them: it is asked at run time, as one library is for all of them.
 *
 * What is marked is compiled twice from the same operations, none of them contracted or reordered: results are equal to
 * the last bit.
 */
#ifndef HSEP_WIDE_H
#define HSEP_WIDE_H

#if (defined(__GNUC__) || defined(__clang__)) && defined(__x86_64__) && !defined(__AVX__)

#include <cpuid.h>

#define HSEP_INLINE __attribute__((always_inline)) static inline
#define HSEP_WIDE __attribute__((target("avx")))

/* Whether the processor has AVX, its operating system saves the registers, and so many multiply-adds are worth the
 * question: it takes up to 10 microseconds in a virtual machine. */
static inline int hsep_is_wide(double multiply_adds)
{
    const double worth = 4e4;
    const unsigned saved = 6; /* registers of SSE and AVX in XCR0 */
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (multiply_adds < worth || !__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_AVX) || !(c & bit_OSXSAVE)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(a), "=d"(d) : "c"(0));
    return (a & saved) == saved;
}

#else

#define HSEP_INLINE static inline
#define HSEP_WIDE

static inline int hsep_is_wide(double multiply_adds)
{
    (void)multiply_adds;
    return 0;
}

#endif

#endif

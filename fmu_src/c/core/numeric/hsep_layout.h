/* Layout of a block of memory: a struct, then its arrays as doubles, each at an offset that the struct holds.
 *
 * One function of a block walks its arrays with a cursor, the end of what is taken so far in doubles: the offsets and
 * the size are the same walk. A block holds no pointers, so a copy of it is its state. Its struct has members of 8
 * bytes alone, which HSEP_ASSERT_WORDS proves: no byte of a state is padding.
 */
#ifndef HSEP_LAYOUT_H
#define HSEP_LAYOUT_H

#include <stdint.h>

/* Fail to compile unless a condition holds; name: unique among all files. */
#define HSEP_ASSERT(name, condition) typedef char hsep_assert_##name[(condition) ? 1 : -1]

/* Assert the size of a struct whose members, this many, have 8 bytes each. */
#define HSEP_ASSERT_WORDS(type, words) HSEP_ASSERT(words_of_##type, sizeof(type) == (words) * sizeof(double))

/* Doubles that a struct takes, where the arrays behind it begin. */
#define HSEP_WORDS(type) ((double)(sizeof(type) / sizeof(double)))

/* Take count doubles at the cursor; return their offset. Counted in double, so that no size can overflow: an offset of
 * 2^53 or more is 0, in a block whose size is refused. */
static inline uint64_t hsep_take(double *end, double count)
{
    const double offset = *end;
    *end += count;
    return offset < 9007199254740992.0 ? (uint64_t)offset : 0;
}

/* Take a block of this many bytes. */
static inline uint64_t hsep_take_block(double *end, double bytes) { return hsep_take(end, bytes / sizeof(double)); }

/* The array, or the block, at an offset of a block. */
static inline double *hsep_at(void *block, uint64_t offset) { return (double *)block + offset; }
static inline const double *hsep_at_const(const void *block, uint64_t offset) { return (const double *)block + offset; }

/* The same in bytes of any alignment, to be read by memcpy. */
static inline const void *hsep_at_bytes(const void *bytes, uint64_t offset)
{
    return (const char *)bytes + offset * sizeof(double);
}

#endif

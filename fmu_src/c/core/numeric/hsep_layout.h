/* Layout of a block of memory: a struct, then its arrays, each at an offset that the struct holds.
 *
 * Every struct with a function hsep_NAME_lay_out or hsep_NAME_size begins a block. A member whose comment has a shape
 * is the offset of that array, one that is named after a block the offset of that block, in words from the
 * beginning of the struct. One function walks them with a cursor, the end of what is taken so far: the offsets and the
 * size are the same walk. A block holds no pointers, so a copy of it is its state. Its struct has members of one size
 * only, which HSEP_ASSERT_WORDS proves: no byte of a state is padding.
 *
 * hsep_NAME_lay_out sets what follows from the parameters and returns the bytes of the block, counted as a number so
 * that no size can overflow: of a mere struct, too, which asks for the size only; where others need only that, it is
 * hsep_NAME_size. hsep_NAME_init fills a block with nothing learned. All functions of a block are reentrant and
 * allocate nothing. What a block needs comes with this header: linkage of its functions, numbers, libm and vectors.
 */
#ifndef HSEP_LAYOUT_H
#define HSEP_LAYOUT_H

#include "hsep_api.h"
#include "hsep_math.h"
#include "hsep_vector.h"

/* Fail to compile unless a condition holds; name: unique among all files. */
#define HSEP_ASSERT(name, condition) typedef char hsep_assert_##name[(condition) ? 1 : -1]

/* Assert the size of a struct whose members, this many, are words. */
#define HSEP_ASSERT_WORDS(type, words) HSEP_ASSERT(words_of_##type, sizeof(type) == (words) * sizeof(hsep_real))

/* Words that a struct takes, where the arrays after it begin. */
#define HSEP_WORDS(type) ((hsep_real)(sizeof(type) / sizeof(hsep_real)))

/* Take count words at the cursor; return their offset. Counted as a number, so that no size can overflow: an offset of
 * HSEP_EXACT or more is 0, in a block whose size is refused. */
static inline hsep_int hsep_take(hsep_real *end, hsep_real count)
{
    const hsep_real offset = *end;
    *end += count;
    return offset < HSEP_EXACT ? (hsep_int)offset : 0;
}

/* Take a block of this many bytes. */
static inline hsep_int hsep_take_block(hsep_real *end, hsep_real bytes)
{
    return hsep_take(end, bytes / sizeof(hsep_real));
}

/* Bytes of a block as an object's size; 0 if it cannot be one. */
static inline size_t hsep_block_bytes(hsep_real bytes) { return bytes < 0.5 * (hsep_real)SIZE_MAX ? (size_t)bytes : 0; }

/* The array at an offset of a block, */
static inline hsep_real *hsep_at(void *block, hsep_int offset) { return (hsep_real *)block + offset; }
static inline const hsep_real *hsep_at_const(const void *block, hsep_int offset)
{
    return (const hsep_real *)block + offset;
}

/* and the block there, which may be of any type. */
static inline void *hsep_part(void *block, hsep_int offset) { return hsep_at(block, offset); }
static inline const void *hsep_part_const(const void *block, hsep_int offset) { return hsep_at_const(block, offset); }

#endif

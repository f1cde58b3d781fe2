/* What a source FMU needs of stdlib.h, as tests/c/msvc/math.h. Microsoft's has this use of the word: it may be no macro. */
#ifndef STDLIB_H
#define STDLIB_H
#include <stddef.h>
__declspec(restrict) void *calloc(size_t, size_t);
void free(void *);
#endif

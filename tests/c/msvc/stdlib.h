/* What a source FMU needs of stdlib.h, as math.h beside it; restrict stands here as in Microsoft's. */
#ifndef STDLIB_H
#define STDLIB_H
#include <stddef.h>
__declspec(restrict) void *calloc(size_t, size_t);
void free(void *);
#endif

/* Count of the blocks of memory that an FMU has not given back: included before everything else by the compiler. */
#include <stdlib.h>

#if defined(__GNUC__)
__attribute__((visibility("default")))
#endif
int counted_blocks(void);

static int counted;

int counted_blocks(void) { return counted; }

static inline void *counted_calloc(size_t count, size_t size)
{
    void *block = calloc(count, size);
    counted += block != NULL;
    return block;
}

static inline void counted_free(void *block)
{
    counted -= block != NULL;
    free(block);
}

#define calloc counted_calloc
#define free counted_free

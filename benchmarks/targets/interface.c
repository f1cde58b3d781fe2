/* A program that needs a predictor or a compensator and nothing else: what the linker adds for it is the library's
 * size. Without KIND it is the program that is subtracted. */
#include "board.h"

#ifdef KIND
#include "hsep.h"

#define JOINED(kind, name) hsep_##kind##_##name
#define FUNCTION(kind, name) JOINED(kind, name)
typedef void (*function)(void);
static function needed[] = {
    (function)hsep_defaults, (function)FUNCTION(KIND, size), (function)FUNCTION(KIND, init),
    (function)FUNCTION(KIND, sample), (function)FUNCTION(KIND, read)};
#else
typedef void (*function)(void);
static function needed[5];
#endif

int main(void)
{
    function *volatile used = needed;
    board_init();
    return used[0] == 0;
}

/* Replay of recorded samples on any board: a line a sample, all of it hexadecimal.
 *
 * case.h has what is replayed: the kind, parameters, samples and weights. The first line is
 *     size began
 * then a line for each sample: what it took in units of the board, and the bits of two outputs, as doubles,
 *     count x_h x_h_std     of a predictor
 *     count x_dm x_h        of a compensator
 * and at the end the stack that the library needed.
 */
#include "board.h"
#include "case.h"
#include "hexadecimal.h"

#define STACK_PAINTED 24000 /* bytes below the caller; more than the library needs */
#define PAINT 0x5Au

static hsep_real block[CASE_BLOCK_SIZE / sizeof(hsep_real)];

/* Where the stack was painted. */
static uintptr_t painted;

/* Paint what lies below the caller's stack. */
__attribute__((noinline)) static void paint(void)
{
    volatile unsigned char canvas[STACK_PAINTED];
    for (size_t i = 0; i < STACK_PAINTED; i++) {
        canvas[i] = PAINT;
    }
    painted = (uintptr_t)canvas;
}

/* Bytes of it that have been written to since. */
__attribute__((noinline)) static uint32_t depth(void)
{
    uint32_t untouched = 0;
    while (untouched < STACK_PAINTED && *(volatile const unsigned char *)(painted + untouched) == PAINT) {
        untouched++;
    }
    return STACK_PAINTED - untouched;
}

/* Process a sample; callgrind counts what is inside. */
__attribute__((noinline)) void replay_sample(const hsep_real sample[2], CASE_OUTPUTS *outputs);

void replay_sample(const hsep_real sample[2], CASE_OUTPUTS *outputs)
{
    (void)CASE_FUNCTION(sample)((CASE_TYPE *)block, sample[0], sample[1]);
    CASE_FUNCTION(read)((const CASE_TYPE *)block, outputs);
}

int main(void)
{
    hsep_parameters parameters;
    CASE_OUTPUTS outputs;
    board_init();
    case_parameters(&parameters);
    const size_t size = CASE_FUNCTION(size)(&parameters);
    if (size == 0 || size > sizeof block) {
        board_write("the parameters are refused, or the block is too small\n");
        return 1;
    }
    paint();
    const hsep_began began =
        CASE_FUNCTION(init)((CASE_TYPE *)block, &parameters, case_samples[0][0], case_weights, case_weights_size);
    write_hexadecimal(size, 8);
    board_write(" ");
    write_hexadecimal(began, 1);
    board_write("\n");
    for (size_t k = 0; k < sizeof case_samples / sizeof case_samples[0]; k++) {
        const uint32_t before = board_count();
        replay_sample(case_samples[k], &outputs);
        write_hexadecimal(board_count() - before, 8);
        write_bits(CASE_FIRST(outputs));
        write_bits(CASE_SECOND(outputs));
        board_write("\n");
    }
    write_hexadecimal(depth(), 8);
    board_write("\n");
    return 0;
}

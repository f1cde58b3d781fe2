/* The board virt (Cortex-A53, 64 bit) as qemu-system-aarch64 emulates it: start, a counter, output by semihosting (Arm:
 * Semihosting for AArch32 and AArch64). With -icount the performance monitor counts instructions one by one. */
#include "board.h"

#include <stddef.h>

enum { SYS_WRITE0 = 0x04, SYS_EXIT = 0x18, APPLICATION_EXIT = 0x20026, RUN_TIME_ERROR = 0x20023 };

int main(void);
void board_start(void);

extern uint64_t link_bss[], link_bss_end[];

/* A gigabyte each: devices below, memory above. Plain memory may be read at any alignment. */
enum { BLOCK = 1, ACCESSED = 1 << 10, SHARED = 3 << 8, MEMORY = 1 << 2 };
__attribute__((aligned(4096), used)) static const uint64_t pages[512] = {
    BLOCK | ACCESSED, 0x40000000u | BLOCK | ACCESSED | SHARED | MEMORY};

__asm__(
    ".section .start, \"ax\"\n"
    ".global _start\n"
    "_start:\n"
    "    mov x0, #(3 << 20)\n" /* CPACR_EL1: no traps of floating-point instructions */
    "    msr cpacr_el1, x0\n"
    "    ldr x0, =0xFF00\n" /* memory of kind 0: devices; of kind 1: written back */
    "    msr mair_el1, x0\n"
    "    ldr x0, =(32 | 1 << 8 | 1 << 10 | 3 << 12 | 1 << 23)\n" /* TCR_EL1: 32 bits of address, 4 KiB, lower half */
    "    msr tcr_el1, x0\n"
    "    adrp x0, pages\n"
    "    msr ttbr0_el1, x0\n"
    "    isb\n"
    "    mrs x0, sctlr_el1\n"
    "    orr x0, x0, #1\n"
    "    msr sctlr_el1, x0\n"
    "    isb\n"
    "    ldr x0, =link_stack_top\n"
    "    mov sp, x0\n"
    "    b board_start\n"
    ".text\n");

static void semihost(uint64_t operation, const void *parameter)
{
    register uint64_t x0 __asm__("x0") = operation;
    register const void *x1 __asm__("x1") = parameter;
    __asm__ volatile("hlt #0xf000" : "+r"(x0) : "r"(x1) : "memory");
}

void board_init(void)
{
    const uint64_t instructions = 0x08; /* INST_RETIRED */
    __asm__ volatile("msr pmevtyper0_el0, %0" : : "r"(instructions));
    __asm__ volatile("msr pmcntenset_el0, %0" : : "r"((uint64_t)1));
    __asm__ volatile("msr pmcr_el0, %0\n\tisb" : : "r"((uint64_t)3)); /* on, from zero */
}

uint32_t board_count(void)
{
    uint64_t count;
    __asm__ volatile("isb\n\tmrs %0, pmevcntr0_el0" : "=r"(count));
    return (uint32_t)count;
}

void board_write(const char *text) { semihost(SYS_WRITE0, text); }

void board_start(void)
{
    for (uint64_t *word = link_bss; word < link_bss_end; word++) {
        *word = 0;
    }
    const uint64_t done[2] = {main() == 0 ? APPLICATION_EXIT : RUN_TIME_ERROR, 0};
    semihost(SYS_EXIT, done);
    for (;;) {}
}

/* The boards mps2-an386 (Cortex-M4F) and mps2-an500 (Cortex-M7) as qemu-system-arm emulates them: start, a counter,
 * output by semihosting (Arm: Semihosting for AArch32 and AArch64).
 *
 * With -icount shift=0 each instruction takes 1 ns of the emulated clock, and a timer at 25 MHz counts once in 40.
 */
#include "board.h"

#include <stddef.h>

#define CPACR (*(volatile uint32_t *)0xE000ED88u)
#define TIMER_CONTROL (*(volatile uint32_t *)0x40000000u) /* CMSDK APB timer 0 */
#define TIMER_VALUE (*(volatile uint32_t *)0x40000004u)
#define TIMER_RELOAD (*(volatile uint32_t *)0x40000008u)

enum { SYS_WRITE0 = 0x04, SYS_EXIT = 0x18, APPLICATION_EXIT = 0x20026, RUN_TIME_ERROR = 0x20023 };

int main(void);

extern uint32_t link_data_from[], link_data[], link_data_end[], link_bss[], link_bss_end[], link_stack_top[];

static void semihost(uint32_t operation, const void *parameter)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

static void leave(uint32_t reason)
{
    semihost(SYS_EXIT, (const void *)(uintptr_t)reason);
    for (;;) {}
}

void board_init(void)
{
    TIMER_CONTROL = 0;
    TIMER_RELOAD = 0xFFFFFFFFu;
    TIMER_VALUE = 0xFFFFFFFFu;
    TIMER_CONTROL = 1;
}

uint32_t board_count(void) { return ~TIMER_VALUE; }

void board_write(const char *text) { semihost(SYS_WRITE0, text); }

static void reset(void)
{
    CPACR |= 0xFu << 20; /* full access to the floating-point unit */
    __asm__ volatile("dsb\n\tisb");
    for (size_t i = 0; &link_data[i] < link_data_end; i++) {
        link_data[i] = link_data_from[i];
    }
    for (uint32_t *word = link_bss; word < link_bss_end; word++) {
        *word = 0;
    }
    leave(main() == 0 ? APPLICATION_EXIT : RUN_TIME_ERROR);
}

static void fault(void) { leave(RUN_TIME_ERROR); }

/* Stack pointer and handlers, as the processor reads them at address 0 (Armv7-M, B1.5.3). */
__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    link_stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault};

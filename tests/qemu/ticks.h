/* The instructions run by a core, as ticks of a qemu clock that counts down. */
#ifndef THENAR_TICKS_H
#define THENAR_TICKS_H

#include <stdint.h>

#define TICKS_MOST 0xffffffu

#ifdef __riscv
static inline void start_ticking(void)
{
}

/* One tick per instruction. */
static inline uint32_t ticks_left(void)
{
    uint32_t retired;

    __asm volatile("csrr %0, minstret" : "=r"(retired));
    return 0u - retired;
}
#else
#define SYSTICK_CONTROL (*(volatile uint32_t *)0xe000e010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xe000e014u)
#define SYSTICK_NOW (*(volatile uint32_t *)0xe000e018u)
#define SYSTICK_RUN 0x5u /* by the core's clock, without interrupts */

static inline void start_ticking(void)
{
    SYSTICK_RELOAD = TICKS_MOST;
    SYSTICK_NOW = 0;
    SYSTICK_CONTROL = SYSTICK_RUN;
}

static inline uint32_t ticks_left(void)
{
    return SYSTICK_NOW;
}
#endif

#endif

/* Start-up of a Cortex-M or of a RISC-V core with one hart: stack, .data and .bss, then main(). No C library is needed. */
#include <stddef.h>
#include <stdint.h>

extern const uint32_t thenar_data_load[];                     /* link.ld: the initial values of .data in flash, */
extern uint32_t thenar_data_start[], thenar_data_end[];       /* their place in RAM, */
extern uint32_t thenar_bss_start[], thenar_bss_end[];         /* zero-initialised variables, */
extern uint32_t thenar_stack_top[];                           /* and the end of RAM */

int main(void);
void thenar_reset(void);
void thenar_fault(void);
void *memcpy(void *to, const void *from, size_t size);
void *memset(void *to, int byte, size_t size);

void thenar_reset(void)
{
    const uint32_t *from = thenar_data_load;

    for (uint32_t *to = thenar_data_start; to != thenar_data_end; ++to) {
        *to = *from;
        ++from;
    }
    for (uint32_t *to = thenar_bss_start; to != thenar_bss_end; ++to) {
        *to = 0u;
    }
    (void)main();
    thenar_fault(); /* firmware cannot return */
}

/* The compiler may call these two in any program (GCC manual, "Standards"). */
__attribute__((weak)) void *memcpy(void *to, const void *from, size_t size)
{
    uint8_t *into = to;
    const uint8_t *out_of = from;

    for (size_t at = 0u; at < size; ++at) {
        into[at] = out_of[at];
    }
    return to;
}

__attribute__((weak)) void *memset(void *to, int byte, size_t size)
{
    uint8_t *into = to;

    for (size_t at = 0u; at < size; ++at) {
        into[at] = (uint8_t)byte;
    }
    return to;
}

#ifdef __riscv
/* The first instructions in flash: the reset entry. */
__attribute__((naked, section(".vectors"), used)) static void first(void)
{
    __asm volatile(".option push\n"
                   ".option norelax\n"
                   "la gp, __global_pointer$\n"
                   "la sp, thenar_stack_top\n"
                   "la t0, 1f\n"
                   "csrw mtvec, t0\n"
                   ".option pop\n"
                   "j thenar_reset\n"
                   ".balign 4\n" /* as mtvec requires */
                   "1: j thenar_fault");
}
#else
/* The 16 vectors of the core (ARMv6-M and ARMv7-M Architecture Reference Manuals, B1.5.3). Interrupts of peripherals
   follow them in the order of the part's data sheet: nothing here enables any. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*handlers[15])(void);
} vectors = {
    thenar_stack_top,
    {
        thenar_reset,
        thenar_fault, /* NMI */
        thenar_fault, /* HardFault */
        thenar_fault, /* MemManage, ARMv7-M */
        thenar_fault, /* BusFault, ARMv7-M */
        thenar_fault, /* UsageFault, ARMv7-M */
        NULL, NULL, NULL, NULL,
        thenar_fault, /* SVCall */
        thenar_fault, /* DebugMonitor, ARMv7-M */
        NULL,
        thenar_fault, /* PendSV */
        thenar_fault, /* SysTick */
    },
};
#endif

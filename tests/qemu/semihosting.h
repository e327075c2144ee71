/* Files, messages and program end through the debugger or qemu (ARM, "Semihosting for AArch32 and AArch64", 2.0). */
#ifndef THENAR_SEMIHOSTING_H
#define THENAR_SEMIHOSTING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SEMIHOSTING_OPEN = 0x01,
    SEMIHOSTING_WRITE0 = 0x04,
    SEMIHOSTING_WRITE = 0x05,
    SEMIHOSTING_READ = 0x06,
    SEMIHOSTING_EXIT = 0x18,
};
enum { SEMIHOSTING_RB = 1, SEMIHOSTING_WB = 5 }; /* open modes: fopen()'s "rb" and "wb" */

#ifdef __riscv
/* The three instructions form one signal: they must be uncompressed and on one page. */
static inline uint32_t semihosting(uint32_t operation, uint32_t argument)
{
    register uint32_t a0 __asm("a0") = operation;
    register uint32_t a1 __asm("a1") = argument;

    __asm volatile(".balign 16\n"
                   ".option push\n"
                   ".option norvc\n"
                   "slli x0, x0, 0x1f\n"
                   "ebreak\n"
                   "srai x0, x0, 7\n"
                   ".option pop" : "+r"(a0) : "r"(a1) : "memory");
    return a0;
}
#else
static inline uint32_t semihosting(uint32_t operation, uint32_t argument)
{
    register uint32_t r0 __asm("r0") = operation;
    register uint32_t r1 __asm("r1") = argument;

    __asm volatile("bkpt #0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}
#endif

static inline uint32_t semihosting_open(const char *name, size_t length, uint32_t mode)
{
    const uint32_t block[3] = {(uint32_t)(uintptr_t)name, mode, (uint32_t)length};

    return semihosting(SEMIHOSTING_OPEN, (uint32_t)(uintptr_t)block);
}

/* Read all of the bytes, or return false. */
static inline bool semihosting_read(uint32_t file, void *bytes, size_t size)
{
    const uint32_t block[3] = {file, (uint32_t)(uintptr_t)bytes, (uint32_t)size};

    return semihosting(SEMIHOSTING_READ, (uint32_t)(uintptr_t)block) == 0u;
}

/* Write all of the bytes, or return false. */
static inline bool semihosting_write(uint32_t file, const void *bytes, size_t size)
{
    const uint32_t block[3] = {file, (uint32_t)(uintptr_t)bytes, (uint32_t)size};

    return semihosting(SEMIHOSTING_WRITE, (uint32_t)(uintptr_t)block) == 0u;
}

static inline void semihosting_print(const char *text)
{
    (void)semihosting(SEMIHOSTING_WRITE0, (uint32_t)(uintptr_t)text);
}

/* End the emulator with status 0 or 1. */
static inline void semihosting_exit(bool failed)
{
    (void)semihosting(SEMIHOSTING_EXIT, failed ? 0x20023u : 0x20026u);
}

#endif

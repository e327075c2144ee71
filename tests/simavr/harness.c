#include "harness.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <simavr/sim_elf.h>

enum { SPL_ADDRESS = 0x5D, SPH_ADDRESS = 0x5E };

void fail(const char *format, ...)
{
    va_list arguments;
    fputs("simavr harness: ", stderr);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    exit(2);
}

uint32_t number(const char *text, const char *what)
{
    char *end;
    unsigned long value = strtoul(text, &end, 0);
    if (end == text || *end != '\0' || value > UINT32_MAX)
        fail("\"%s\" is no %s", text, what);
    return (uint32_t)value;
}

/* stdout carries answers: what simavr has to say about errors goes to stderr, the rest nowhere. */
static void log_errors(struct avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level <= LOG_ERROR)
        vfprintf(stderr, format, arguments);
}

avr_t *load(const char *mcu, uint32_t frequency, const char *elf)
{
    avr_global_logger_set(log_errors);
    if (access(elf, R_OK) != 0)
        fail("%s cannot be read", elf);
    elf_firmware_t program;
    memset(&program, 0, sizeof program);
    if (elf_read_firmware(elf, &program) != 0)
        fail("%s is no program for an AVR", elf);
    avr_t *avr = avr_make_mcu_by_name(mcu);
    if (avr == NULL)
        fail("simavr knows no \"%s\"", mcu);
    avr_init(avr);
    avr_load_firmware(avr, &program);
    avr->frequency = frequency;
    return avr;
}

uint16_t stack_pointer(const avr_t *avr)
{
    return (uint16_t)(avr->data[SPL_ADDRESS] | avr->data[SPH_ADDRESS] << 8);
}

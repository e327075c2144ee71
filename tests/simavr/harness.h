/* What both programs need of libsimavr: a microcontroller with a program in it, and a way to stop with a message. */
#ifndef THENAR_HARNESS_H
#define THENAR_HARNESS_H

#include <stdint.h>
#include <stdnoreturn.h>

#include <simavr/sim_avr.h>

/* Print one line to stderr, after the program's name, and exit with code 2. */
noreturn void fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Return `text` as a number, decimal or 0x..., or fail and say that it should have been `what`. */
uint32_t number(const char *text, const char *what);

/* Return a microcontroller `mcu` ("atmega328p") that runs at `frequency` Hz and has the program of the file `elf`. */
avr_t *load(const char *mcu, uint32_t frequency, const char *elf);

/* Return what the stack pointer holds. */
uint16_t stack_pointer(const avr_t *avr);

#endif

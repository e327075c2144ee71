/* The AVR's two-wire interface as the data sheet has it, master only: every condition and byte takes its time. */
#ifndef THENAR_BOARD_TWI_H
#define THENAR_BOARD_TWI_H

#include <stdbool.h>

#include "harness.h"

/* Take over the interface of `avr` from simavr, whose own is wrong in some versions (1.6: a period of SCL is always a
 * microsecond, START and the address take none, TWINT is not cleared). */
void twi_attach(avr_t *avr);

/* Hold SDA low, as a chip that lost count does, or let it go. */
void twi_hold(bool held);

/* Return whether a chip is sending a byte. It goes on after a reset, and holds SDA low, until SCL was low nine times. */
bool twi_reads(void);

/* All chips lost power, and hold nothing. */
void twi_power(void);

/* Return how many START conditions there were. */
uint32_t twi_starts(void);

#endif

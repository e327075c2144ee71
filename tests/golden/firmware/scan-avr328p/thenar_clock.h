/* The board's clock: microseconds since boot, 32 bits, which wrap after 71.6 minutes and never go back otherwise.

   thenar 0.1.0, template avr/thenar_clock.h.j2. */
#ifndef THENAR_CLOCK_H
#define THENAR_CLOCK_H

#include <stdint.h>

/* Start the clock at 0. It takes Timer 1, and interrupts. */
void thenar_clock_begin(void);

/* Return the time. Interrupts must never be off for 10000 us. */
uint32_t thenar_clock_us(void);

#endif

/* The board's clock: microseconds since boot, 32 bits, which wrap after 71.6 minutes and never go back otherwise.

   thenar 0.1.0, template board/thenar_clock.h.j2. */
#ifndef THENAR_CLOCK_H
#define THENAR_CLOCK_H

#include <stdint.h>

/* Start the clock. */
void thenar_clock_begin(void);

/* Return the time. */
uint32_t thenar_clock_us(void);

#endif

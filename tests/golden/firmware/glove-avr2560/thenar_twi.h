/* Master of the I2C bus, at 400000 Hz. No chip, present, absent or stuck, can hold it up for long.

   thenar 0.1.0, template board/thenar_twi.h.j2. */
#ifndef THENAR_TWI_H
#define THENAR_TWI_H

#include <stdbool.h>
#include <stdint.h>

/* Free the bus, as far as clocks can do that, and take it. */
void thenar_twi_begin(void);

/* Write bytes to a chip, then, after a repeated START, read bytes from it; either part may have no bytes, not both.

   Return false if nobody acknowledged, or the bus was stuck: then it was freed, as far as clocks can do that. All of it
   takes 1800 us at most, and 110 us to free the bus. */
bool thenar_twi_transfer(uint8_t address, const uint8_t *written, uint8_t to_write, uint8_t *read, uint8_t to_read);

#endif

/* Master of the I2C bus, at 400000 Hz. No chip, present, absent or stuck, can block it for long.

   thenar 0.1.0, template board/thenar_twi.h.j2. */
#ifndef THENAR_TWI_H
#define THENAR_TWI_H

#include <stdbool.h>
#include <stdint.h>

/* Free the bus, if clock pulses can, and start the master. */
void thenar_twi_begin(void);

/* Write bytes to a chip, then, after a repeated START, read bytes from it; either part may have no bytes, not both.

   Return false if no chip acknowledged, or the bus was stuck; it is then freed, if clock pulses can. The transfer takes
   1800 us at most, and freeing the bus 110 us. */
bool thenar_twi_transfer(uint8_t address, const uint8_t *written, uint8_t to_write, uint8_t *read, uint8_t to_read);

#endif

/* Port expanders on the I2C bus: what they do with the bytes of a transaction. */
#ifndef THENAR_BOARD_CHIPS_H
#define THENAR_BOARD_CHIPS_H

#include <stdbool.h>
#include <stdint.h>

/* Put a chip of `kind` ("mcp23017") at `address`. */
void chips_add(const char *kind, uint8_t address);

/* Let key `key` be at pin `pin` (0 to 23) of the chip at `address`; closed it pulls the pin low, or high. */
void chips_add_key(uint16_t key, uint8_t address, uint8_t pin, bool closed_high);

/* Close or open a key. Return false where there is no such key here. */
bool chips_close(uint16_t key, bool closed);

/* Take a chip off the bus, or put it back as after power-on. Return false where there is none. */
bool chips_plug(uint8_t address, bool plugged);

/* Let all chips lose power and have it back. */
void chips_power(void);

/* One transaction: an address; whether a chip acknowledges it. Then bytes to it, acknowledged or not, or from it. */
bool chips_start(uint8_t address);
bool chips_write(uint8_t byte);
uint8_t chips_read(void);

#endif

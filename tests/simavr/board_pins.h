/* Switches between pins of the AVR, or between a pin and ground: what the pins then read. */
#ifndef THENAR_BOARD_PINS_H
#define THENAR_BOARD_PINS_H

#include <stdbool.h>

#include "harness.h"

/* Take over what reading and writing the ports of `avr` does. A wire needs `rise_us` to rise once only a
 * pull-up pulls it. */
void pins_attach(avr_t *avr, uint32_t rise_us);

/* Let key `key` connect the pin `from` ("PD2") with the pin `to`, or with ground where `to` is "GND". With a diode
 * current flows from `from` to `to` only. */
void pins_add(uint16_t key, const char *from, const char *to, bool diode);

/* Close or open a key. Return false where there is no such key here. */
bool pins_close(uint16_t key, bool closed);

#endif

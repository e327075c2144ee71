/* Each switch has a pin, which is pulled up, and low while the switch is closed.

   thenar 0.1.0, template sketch/thenar_pins.cpp.j2. */
#include <Arduino.h>
#include <string.h>

extern "C" {
#include "thenar_board.h"
#include "thenar_keys.h"
}

#define CHARGE_US 100u /* for the switches' wires to rise by their pull-ups */

static const uint8_t pins[THENAR_KEYS] = {
    4u, /* 0: thumb tip */
    5u, /* 1: index tip */
    13u, /* 2: index middle */
    14u, /* 3: middle tip */
    18u, /* 4: palm radial */
    19u, /* 5: palm ulnar */
};

void thenar_keys_begin(void)
{
    for (const uint8_t pin : pins) {
        pinMode(pin, INPUT_PULLUP);
    }
    delayMicroseconds(CHARGE_US);
}

bool thenar_keys_scan(uint8_t *closed, uint8_t *known)
{
    (void)memset(closed, 0, THENAR_BITMAP_BYTES);
    (void)memset(known, 0xFF, THENAR_BITMAP_BYTES);
    for (uint16_t key = 0u; key < THENAR_KEYS; key++) {
        if (digitalRead(pins[key]) == LOW) {
            closed[key >> 3] |= (uint8_t)(1u << (key & 7u));
        }
    }
    return true;
}

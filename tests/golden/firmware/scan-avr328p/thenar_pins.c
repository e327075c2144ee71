/* Each switch has a pin, which is pulled up, and low while the switch is closed.

   thenar 0.1.0, template avr/thenar_pins.c.j2. */
#include "thenar_keys.h"

#include <avr/io.h>
#include <string.h>

#include "thenar_board.h"

#define CHARGE_CYCLES 1600u /* 100 us: for the switches' wires to rise by their pull-ups */

void thenar_keys_begin(void)
{
    DDRB &= (uint8_t)~0x03u;
    PORTB |= 0x03u;
    DDRD &= (uint8_t)~0x3Cu;
    PORTD |= 0x3Cu;
    __builtin_avr_delay_cycles(CHARGE_CYCLES);
}

bool thenar_keys_scan(uint8_t *closed, uint8_t *known)
{
    /* Read all ports in direct succession: the keys of a hand are sampled within a microsecond. */
    const uint8_t port_b = (uint8_t)~PINB;
    const uint8_t port_d = (uint8_t)~PIND;

    (void)memset(closed, 0, THENAR_BITMAP_BYTES);
    if ((port_d & _BV(PD2)) != 0u) { /* 0: thumb tip */
        closed[0] |= 0x01u;
    }
    if ((port_d & _BV(PD3)) != 0u) { /* 1: index tip */
        closed[0] |= 0x02u;
    }
    if ((port_d & _BV(PD4)) != 0u) { /* 2: index middle */
        closed[0] |= 0x04u;
    }
    if ((port_d & _BV(PD5)) != 0u) { /* 3: middle tip */
        closed[0] |= 0x08u;
    }
    if ((port_b & _BV(PB0)) != 0u) { /* 4: palm radial */
        closed[0] |= 0x10u;
    }
    if ((port_b & _BV(PB1)) != 0u) { /* 5: palm ulnar */
        closed[0] |= 0x20u;
    }
    (void)memset(known, 0xFF, THENAR_BITMAP_BYTES);
    return true;
}

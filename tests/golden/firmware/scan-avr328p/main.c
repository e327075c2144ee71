/* A scanner board. It reads switches on pins, and sends them to the host (protocol 1 of thenar's scanner board).

   A reset at any moment, even in the middle of a frame, ends that frame with a 00 and sends a HELLO.

   thenar 0.1.0, template avr/main.c.j2. */
#include <avr/interrupt.h>
#include <stdbool.h>
#include <stdint.h>

#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_reset.h"
#include "thenar_turn.h"
#include "thenar_uart0.h"

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    return thenar_uart0_send(frame, length);
}

bool thenar_port_receive(uint8_t *byte)
{
    return thenar_uart0_receive(byte);
}

int main(void)
{
    thenar_uart0_begin();
    thenar_clock_begin();
    sei();
    thenar_turn_begin();
    thenar_reset_watch();
    for (;;) {
        thenar_turn();
        thenar_reset_watched();
    }
}

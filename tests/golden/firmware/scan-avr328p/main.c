/* A scanner board. It reads switches on pins, and tells the host of them (protocol 1 of thenar's scanner board).

   A reset at any moment, even in the middle of a frame, ends that frame with a 00 and begins with a HELLO.

   thenar 0.1.0, template avr/scan_main.c.j2. */
#include <avr/interrupt.h>
#include <stdbool.h>
#include <stdint.h>

#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_debounce.h"
#include "thenar_due.h"
#include "thenar_keys.h"
#include "thenar_reset.h"
#include "thenar_uart0.h"

/* So many of the host's bytes are taken before it is looked whether a scan is due: they may come without end. */
#define BYTES_A_TURN 16u

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    return thenar_uart0_send(frame, length);
}

static void scan(uint32_t now_us)
{
    uint8_t closed[THENAR_BITMAP_BYTES];
    uint8_t known[THENAR_BITMAP_BYTES];

    (void)thenar_keys_scan(closed, known);
    thenar_board_found(known);
    thenar_debounce(closed, known, now_us);
    thenar_board_scanned(closed, known, true, now_us);
}

int main(void)
{
    thenar_uart0_begin();
    thenar_clock_begin();
    sei();
    thenar_board_boot(thenar_clock_us());
    thenar_keys_begin();
    thenar_due_begin(thenar_clock_us());
    thenar_reset_watch();
    for (;;) {
        uint32_t now_us = thenar_clock_us();
        uint8_t byte;

        for (uint8_t taken = 0u; (taken < BYTES_A_TURN) && thenar_uart0_receive(&byte); taken++) {
            thenar_board_receive(byte, now_us);
        }
        if (thenar_due(now_us)) {
            scan(thenar_clock_us());
        }
        thenar_reset_watched();
    }
}

/* A turn of a board that scans; described in thenar_turn.h.

   thenar 0.1.0, template board/scan_turn.c.j2. */
#include "thenar_turn.h"

#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_debounce.h"
#include "thenar_due.h"
#include "thenar_keys.h"

/* Bytes taken from the host before checking whether a scan is due: the host may send without pause. */
#define BYTES_A_TURN 16u

static void scan(uint32_t now_us)
{
    uint8_t closed[THENAR_BITMAP_BYTES];
    uint8_t known[THENAR_BITMAP_BYTES];

    (void)thenar_keys_scan(closed, known);
    thenar_board_found(known);
    thenar_debounce(closed, known, now_us);
    thenar_board_scanned(closed, known, now_us);
}

void thenar_turn_begin(void)
{
    thenar_board_boot(thenar_clock_us());
    thenar_keys_begin();
    thenar_due_begin(thenar_clock_us());
}

void thenar_turn(void)
{
    const uint32_t now_us = thenar_clock_us();
    uint8_t byte;

    for (uint8_t taken = 0u; (taken < BYTES_A_TURN) && thenar_port_receive(&byte); taken++) {
        thenar_board_receive(byte, now_us);
    }
    if (thenar_due(now_us)) {
        scan(thenar_clock_us());
    }
}

/* The schedule of scans; described in thenar_due.h.

   thenar 0.1.0, template board/thenar_due.c.j2. */
#include "thenar_due.h"

#include "thenar_board.h"

static uint32_t last_us; /* when the last scan was due */

void thenar_due_begin(uint32_t now_us)
{
    last_us = now_us - thenar_board_scan_us();
}

bool thenar_due(uint32_t now_us)
{
    const uint32_t period_us = thenar_board_scan_us();
    const uint32_t passed_us = now_us - last_us;
    bool due = true;

    if (passed_us < period_us) {
        due = false;
    } else if ((passed_us - period_us) < period_us) {
        last_us += period_us;
    } else {
        last_us = now_us;
        thenar_board_overrun();
    }
    return due;
}

/* When to scan: every thenar_board_scan_us(), at steady times.

   thenar 0.1.0, template board/thenar_due.h.j2. */
#ifndef THENAR_DUE_H
#define THENAR_DUE_H

#include <stdbool.h>
#include <stdint.h>

/* Begin: a scan is due. */
void thenar_due_begin(uint32_t now_us);

/* Return whether a scan is due, once for each. One that begins when the next was due is an overrun, and those that
   were left out by then are not made up for. */
bool thenar_due(uint32_t now_us);

#endif

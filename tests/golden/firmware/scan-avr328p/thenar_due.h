/* The schedule of scans: one every thenar_board_scan_us(), at regular times.

   thenar 0.1.0, template board/thenar_due.h.j2. */
#ifndef THENAR_DUE_H
#define THENAR_DUE_H

#include <stdbool.h>
#include <stdint.h>

/* Start: a scan is due. */
void thenar_due_begin(uint32_t now_us);

/* Return whether a scan is due, once for each. A scan that begins when the next was due is an overrun; the scans missed
   until then are not made up for. */
bool thenar_due(uint32_t now_us);

#endif

/* The keys: switches on port expanders.

   thenar 0.1.0, template board/thenar_keys.h.j2. */
#ifndef THENAR_KEYS_H
#define THENAR_KEYS_H

#include <stdbool.h>
#include <stdint.h>

/* Bitmaps: key k is bit k % 8 of byte k / 8, and the bits beyond the last key are 0. */

/* Configure the pins. */
void thenar_keys_begin(void);

/* Read every key into `closed`, and the keys that were read into `known`; unread keys are 0 in both. Return whether all
   were read, and none can be a ghost. */
bool thenar_keys_scan(uint8_t *closed, uint8_t *known);

/* Check one chip if that is due: whether it is still set up, or is back. */
void thenar_keys_attend(uint32_t now_us);

#endif

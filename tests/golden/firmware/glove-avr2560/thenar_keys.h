/* The keys: switches on port expanders.

   thenar 0.1.0, template board/thenar_keys.h.j2. */
#ifndef THENAR_KEYS_H
#define THENAR_KEYS_H

#include <stdbool.h>
#include <stdint.h>

/* Bitmaps: key k is bit k % 8 of byte k / 8, and the bits beyond the last key are 0. */

/* Make the pins what they are to be. */
void thenar_keys_begin(void);

/* Read every key into `closed`, and into `known` which of them were read; those that were not are 0 in both. Return
   whether all were, and none can be a ghost. */
bool thenar_keys_scan(uint8_t *closed, uint8_t *known);

/* How many readings a scan has; number `port` of them, added to both bitmaps. Return whether it succeeded. */
#define THENAR_KEYS_PORTS 2u
bool thenar_keys_read(uint8_t port, uint8_t *closed, uint8_t *known);

/* See to one chip, as often as is due: check that it is still set up, or whether it is back. */
void thenar_keys_attend(uint32_t now_us);

#endif

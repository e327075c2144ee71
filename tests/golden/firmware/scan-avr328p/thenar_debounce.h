/* Debouncing: a press is reported as soon as it is read, a release once the contact has rested.

   thenar 0.1.0, template board/thenar_debounce.h.j2. */
#ifndef THENAR_DEBOUNCE_H
#define THENAR_DEBOUNCE_H

#include <stdint.h>

/* Start with every key open and no debouncing. */
void thenar_debounce_boot(void);

/* Ignore readings of a key for press_us after a press; open it once it was read open for release_us without a closed
   reading in between, or would be before the next scan. Running timers end; no key changes. */
void thenar_debounce_set(uint16_t press_us, uint16_t release_us);

/* Reset the eight keys of a byte: they are open, and their timers are stopped. */
void thenar_debounce_forget(uint16_t byte, uint8_t forgotten);

/* Take a scan and replace it by the debounced closed keys. Key k is bit k % 8 of byte k / 8; those in `known` were read
   at now_us, the others keep their state, and their timers run on. Times are correct across the clock's wrap as long as
   two calls are less than 71 minutes apart. */
void thenar_debounce(uint8_t *bitmap, const uint8_t *known, uint32_t now_us);

#endif

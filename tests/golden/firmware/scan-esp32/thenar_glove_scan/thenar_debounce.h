/* Debouncing: a press is told as soon as it is read, a release once the contact has rested.

   thenar 0.1.0, template board/thenar_debounce.h.j2. */
#ifndef THENAR_DEBOUNCE_H
#define THENAR_DEBOUNCE_H

#include <stdint.h>

/* Begin: every key open, no debouncing. */
void thenar_debounce_boot(void);

/* For press_us after a press, readings of a key are ignored; it opens once it was read open for release_us without a
   closed reading in between, or would have been before the next scan. Times that run end; no key changes. */
void thenar_debounce_set(uint16_t press_us, uint16_t release_us);

/* Begin anew with eight keys of a byte: they are open, and no time of theirs runs. */
void thenar_debounce_forget(uint16_t byte, uint8_t forgotten);

/* Take a scan and put in its place which keys are closed. Key k is bit k % 8 of byte k / 8; those in `known` were read
   at now_us, the others keep their state, and their times run on. Times are right across the clock's wrap as long as
   two calls are less than 71 minutes apart. */
void thenar_debounce(uint8_t *bitmap, const uint8_t *known, uint32_t now_us);

#endif

/* The watchdog: a program that hangs starts again, and says so by its HELLO.

   thenar 0.1.0, template avr/thenar_reset.h.j2. */
#ifndef THENAR_RESET_H
#define THENAR_RESET_H

/* Start the watchdog; thenar_reset_watched() must then be called again within a second. */
void thenar_reset_watch(void);
void thenar_reset_watched(void);

#endif

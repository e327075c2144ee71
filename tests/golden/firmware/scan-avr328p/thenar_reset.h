/* The watchdog restarts a program that hangs, and the HELLO reports it.

   thenar 0.1.0, template avr/thenar_reset.h.j2. */
#ifndef THENAR_RESET_H
#define THENAR_RESET_H

/* Start the watchdog; from then on call thenar_reset_watched() at least once a second. */
void thenar_reset_watch(void);
void thenar_reset_watched(void);

#endif

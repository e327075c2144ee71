/* A reset by the watchdog leaves it running with its shortest period, so it is stopped before anything else.

   thenar 0.1.0, template avr/thenar_reset.c.j2. */
#include "thenar_reset.h"

#include <avr/io.h>
#include <avr/wdt.h>

/* Runs before variables are initialised (.init3), inline in the start-up code: it is not called. */
void thenar_reset_early(void) __attribute__((naked, used, section(".init3")));

void thenar_reset_early(void)
{
    MCUSR = 0u;
    wdt_disable();
}

void thenar_reset_watch(void)
{
    wdt_enable(WDTO_1S);
}

void thenar_reset_watched(void)
{
    wdt_reset();
}

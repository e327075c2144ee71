/* Timer 1 counts an eighth of 16000000 Hz and restarts every 20 ms; its interrupt adds these up. Interrupts must
   never be off for 10000 us.

   thenar 0.1.0, template avr/thenar_clock.c.j2. */
#include "thenar_clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define PERIOD_US 20000u
#define COUNTS 40000u /* timer counts per period */
#define US_A_COUNT UINT32_C(32768) /* 65536ths of a microsecond, rounded down */

static volatile uint32_t periods_us;

ISR(TIMER1_COMPA_vect)
{
    periods_us += PERIOD_US;
}

void thenar_clock_begin(void)
{
    TCCR1B = 0u;
    TCCR1A = 0u;
    TCNT1 = 0u;
    OCR1A = COUNTS - 1u;
    periods_us = 0u;
    TIFR1 = _BV(OCF1A);
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(WGM12) | _BV(CS11);
}

uint32_t thenar_clock_us(void)
{
    const uint8_t status = SREG;
    uint32_t us;
    uint16_t count;

    cli();
    us = periods_us;
    count = TCNT1;
    /* The timer may have restarted just before it was read, with its interrupt still pending. */
    if (((TIFR1 & _BV(OCF1A)) != 0u) && (count < (COUNTS / 2u))) {
        us += PERIOD_US;
    }
    SREG = status;
    return us + ((count * US_A_COUNT) >> 16);
}

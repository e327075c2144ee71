/* The clock of Arduino's core.

   thenar 0.1.0, template sketch/thenar_clock.cpp.j2. */
#include <Arduino.h>

extern "C" {
#include "thenar_clock.h"
}

void thenar_clock_begin(void)
{
    /* It has run since boot. */
}

uint32_t thenar_clock_us(void)
{
    return (uint32_t)micros();
}

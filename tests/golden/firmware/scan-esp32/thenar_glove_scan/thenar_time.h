/* Time in microseconds, 32 bits, which wraps after 71.6 minutes.

   thenar 0.1.0, template board/thenar_time.h.j2. */
#ifndef THENAR_TIME_H
#define THENAR_TIME_H

#include <stdint.h>

/* A time at most this much before the last one (16.8 s) counts as backwards; a larger step is a wrap. */
#define THENAR_BACK_US UINT32_C(0xFFFFFF)

/* Return the time since *then, and set *then to now. If time goes backwards, return 0 and leave *then. */
static inline uint32_t thenar_elapsed(uint32_t *then, uint32_t now_us)
{
    uint32_t elapsed = now_us - *then;

    if (elapsed > (UINT32_MAX - THENAR_BACK_US)) {
        elapsed = 0u;
    } else {
        *then = now_us;
    }
    return elapsed;
}

#endif

/* Time in microseconds, 32 bits, which wraps after 71.6 minutes.

   thenar 0.1.0, template board/thenar_time.h.j2. */
#ifndef THENAR_TIME_H
#define THENAR_TIME_H

#include <stdint.h>

/* A time before the last one by this much at most (16.8 s) has gone back; one that seems further back is later. */
#define THENAR_BACK_US UINT32_C(0xFFFFFF)

/* Return how long ago *then was, and move it to now. Time that goes back stands still: 0, and *then stays. */
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

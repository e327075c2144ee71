/* Debouncing of the keys of thenar_config.h; described in thenar_debounce.h.

   A key's timer runs in one of two states: locked (just pressed or just released, ignored), or opening (closed, but
   read open). One count of microseconds per key serves both, since the lock after a release lasts for the rest of it.

   thenar 0.1.0, template board/thenar_debounce.c.j2. */
#include "thenar_debounce.h"

#include <stdbool.h>

#include "thenar_config.h"
#include "thenar_time.h"

#define BYTES ((THENAR_KEYS + 7u) / 8u)
#define KEYS_OF_LAST_BYTE (0xFFu >> ((BYTES * 8u) - THENAR_KEYS))
#define LONGEST_US 0xFFFFu

typedef struct {
    uint32_t time_us;    /* of the last scan */
    uint16_t press_us;
    uint16_t release_us;
    uint16_t period_us;  /* the shortest recent one, since the next scan may come as soon; 0: unknown */
    bool begun;
    uint8_t closed[BYTES];
    uint8_t locked[BYTES];
    uint8_t opening[BYTES];
    uint16_t left_us[THENAR_KEYS];
} key_states;

static key_states keys;

void thenar_debounce_set(uint16_t press_us, uint16_t release_us)
{
    keys.press_us = press_us;
    keys.release_us = release_us;
    for (uint16_t byte = 0u; byte < BYTES; byte++) {
        keys.locked[byte] = 0u;
        keys.opening[byte] = 0u;
    }
}

void thenar_debounce_boot(void)
{
    thenar_debounce_set(0u, 0u);
    keys.begun = false;
    keys.period_us = 0u;
    for (uint16_t byte = 0u; byte < BYTES; byte++) {
        keys.closed[byte] = 0u;
    }
}

void thenar_debounce_forget(uint16_t byte, uint8_t forgotten)
{
    keys.closed[byte] &= (uint8_t)~forgotten;
    keys.locked[byte] &= (uint8_t)~forgotten;
    keys.opening[byte] &= (uint8_t)~forgotten;
}

/* Record the time of a scan; return the time since the last one, at most 65535: no timer runs longer. */
static uint16_t advance(uint32_t now_us)
{
    uint32_t interval;

    if (!keys.begun) {
        keys.begun = true;
        keys.time_us = now_us;
    }
    interval = thenar_elapsed(&keys.time_us, now_us);
    if (interval > LONGEST_US) {
        interval = LONGEST_US;
    }
    if ((keys.period_us == 0u) || (interval <= keys.period_us)) {
        if (interval > 0u) {
            keys.period_us = (uint16_t)interval;
        }
    } else {
        const uint32_t grown = (uint32_t)keys.period_us + (keys.period_us >> 2) + 1u;

        keys.period_us = (uint16_t)((interval < grown) ? interval : grown);
    }
    return (uint16_t)interval;
}

/* Advance the timers of eight keys, and clear the locks that end. */
static void run_on(uint16_t byte, uint16_t elapsed_us)
{
    const uint8_t running = (uint8_t)(keys.locked[byte] | keys.opening[byte]);
    uint16_t *left = &keys.left_us[byte * 8u];
    uint8_t mask = 1u;

    for (uint8_t bit = 0u; bit < 8u; bit++) {
        if ((running & mask) != 0u) {
            left[bit] = (left[bit] > elapsed_us) ? (uint16_t)(left[bit] - elapsed_us) : 0u;
            if (left[bit] == 0u) {
                keys.locked[byte] &= (uint8_t)~mask;
            }
        }
        mask = (uint8_t)(mask << 1);
    }
}

/* Lock a key for the rest of its time. */
static void lock(uint16_t byte, uint8_t mask, uint16_t left_us)
{
    if (left_us > 0u) {
        keys.locked[byte] |= mask;
    }
}

/* Take a key that reads open: it opens if the next scan would come too late for its release. */
static void read_open(uint16_t byte, uint8_t mask, uint16_t *left_us)
{
    if ((keys.opening[byte] & mask) == 0u) {
        *left_us = keys.release_us;
        keys.opening[byte] |= mask;
    }
    if (*left_us <= keys.period_us) {
        keys.opening[byte] &= (uint8_t)~mask;
        keys.closed[byte] &= (uint8_t)~mask;
        lock(byte, mask, *left_us);
    }
}

/* Return which of eight keys were read and are not locked. */
static uint8_t looked_at(uint16_t byte, uint8_t known)
{
    const uint8_t there = (uint8_t)((byte == (BYTES - 1u)) ? KEYS_OF_LAST_BYTE : 0xFFu);

    return (uint8_t)(known & there & (uint8_t)~keys.locked[byte]);
}

/* Process the changes of eight keys, except ignored ones. */
static void change(uint16_t byte, uint8_t pressed, uint8_t opened)
{
    uint16_t *left = &keys.left_us[byte * 8u];
    uint8_t mask = 1u;

    for (uint8_t bit = 0u; bit < 8u; bit++) {
        if ((opened & mask) != 0u) {
            read_open(byte, mask, &left[bit]);
        } else if ((pressed & mask) != 0u) {
            left[bit] = keys.press_us;
            keys.closed[byte] |= mask;
            lock(byte, mask, keys.press_us);
        } else {
            /* no change of this key */
        }
        mask = (uint8_t)(mask << 1);
    }
}

void thenar_debounce(uint8_t *bitmap, const uint8_t *known, uint32_t now_us)
{
    const uint16_t elapsed_us = advance(now_us);

    for (uint16_t byte = 0u; byte < BYTES; byte++) {
        uint8_t free_keys;
        uint8_t changed;

        if ((keys.locked[byte] | keys.opening[byte]) != 0u) {
            run_on(byte, elapsed_us);
        }
        free_keys = looked_at(byte, known[byte]);
        changed = (uint8_t)((bitmap[byte] ^ keys.closed[byte]) & free_keys);
        /* A closed reading means that it was bounce: the key does not open. */
        keys.opening[byte] &= (uint8_t)~(bitmap[byte] & free_keys);
        if (changed != 0u) {
            change(byte, (uint8_t)(changed & bitmap[byte]), (uint8_t)(changed & (uint8_t)~bitmap[byte]));
        }
        bitmap[byte] = keys.closed[byte];
    }
}

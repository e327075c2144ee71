/* A glove that recognises by itself. It reads switches on port expanders, and tells the host of them and of the
   grasp type (protocol 1 of thenar's scanner board).

   Without an input (a chip that does not answer, joints that do not come, a key that may be a ghost) the grasp is not
   known: it is told as degraded, for the tables hold no stand-in for what is missing.

   A reset at any moment, even in the middle of a frame, ends that frame with a 00 and begins with a HELLO.

   thenar 0.1.0, template avr/glove_main.c.j2. */
#include <avr/interrupt.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "thenar_glove.h"
#include "thenar_glove_decided.h"
#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_debounce.h"
#include "thenar_due.h"
#include "thenar_joints.h"
#include "thenar_keys.h"
#include "thenar_reset.h"
#include "thenar_uart0.h"

/* So many of the host's bytes are taken before it is looked whether a scan is due: they may come without end. */
#define BYTES_A_TURN 16u

/* The keys as the classifier knows them. */
static uint8_t seen[THENAR_BITMAP_BYTES];

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    return thenar_uart0_send(frame, length);
}

static void show_key(uint16_t key, bool closed)
{
    if (key < THENAR_KEYS) {
        thenar_glove_set_switch((uint8_t)key, closed);
    }
}

/* Show the classifier which keys are closed. */
static void show(const uint8_t *closed)
{
    for (uint8_t byte = 0u; byte < THENAR_BITMAP_BYTES; byte++) {
        const uint8_t changed = (uint8_t)(seen[byte] ^ closed[byte]);
        uint8_t mask = 1u;

        seen[byte] = closed[byte];
        for (uint8_t bit = 0u; (bit < 8u) && (changed != 0u); bit++) {
            if ((changed & mask) != 0u) {
                show_key((uint16_t)((byte * 8u) + bit), (closed[byte] & mask) != 0u);
            }
            mask = (uint8_t)(mask << 1);
        }
    }
}

/* Return by how many steps a grasp type leads the second. */
static uint16_t margin(uint8_t grasp)
{
    int16_t second = INT16_MIN;

    for (uint8_t other = 0u; other < THENAR_GLOVE_CLASSES; other++) {
        if ((other != grasp) && (thenar_glove_scores[other] > second)) {
            second = thenar_glove_scores[other];
        }
    }
    return (uint16_t)((uint16_t)thenar_glove_scores[grasp] - (uint16_t)second);
}

static void tell_grasp(uint8_t grasp, bool complete, uint8_t flags, uint32_t now_us)
{
    if (complete) {
        thenar_board_grasp(grasp, margin(grasp), flags, now_us);
    } else {
        thenar_board_grasp(THENAR_NO_GRASP, 0u, THENAR_GRASP_DEGRADED, now_us);
    }
}

/* What was not read keeps its last state for the host, lost or not: so often everything is read. */
#define WHOLE_US UINT32_C(50000)

static uint32_t whole_at_us = 0u - WHOLE_US; /* so the first scan is one */

/* Return whether this scan is to read everything. */
static bool whole_is_due(uint32_t now_us)
{
    const bool due = (now_us - whole_at_us) >= WHOLE_US;

    if (due) {
        whole_at_us = now_us;
    }
    return due;
}

/* Read port by port, until no state of the others could change the grasp type. The classifier is shown the switches as
   they are read, those not read yet as open; debouncing is for what the host is told of the keys. */
static void scan(uint32_t now_us)
{
    const bool whole = whole_is_due(now_us);
    bool complete = thenar_joints_read(now_us);
    bool decided = false;
    uint8_t closed[THENAR_BITMAP_BYTES];
    uint8_t known[THENAR_BITMAP_BYTES];
    uint8_t grasp = THENAR_NO_GRASP;

    (void)memset(closed, 0, sizeof closed);
    (void)memset(known, 0, sizeof known);
    for (uint8_t port = 0u; (port < THENAR_KEYS_PORTS) && !decided; port++) {
        complete = thenar_keys_read(port, closed, known) && complete;
        show(closed);
        grasp = thenar_glove_update();
        decided = complete && !whole && (port < (THENAR_KEYS_PORTS - 1u)) && thenar_glove_decided(port, grasp);
    }
    thenar_board_found(known);
    thenar_debounce(closed, known, now_us);
    thenar_board_scanned(closed, known, !decided, now_us);
    tell_grasp(grasp, complete, decided ? THENAR_GRASP_EARLY : 0u, now_us);
}

int main(void)
{
    thenar_uart0_begin();
    thenar_clock_begin();
    sei();
    thenar_board_boot(thenar_clock_us());
    thenar_keys_begin();
    thenar_joints_begin();
    thenar_due_begin(thenar_clock_us());
    thenar_reset_watch();
    for (;;) {
        uint32_t now_us = thenar_clock_us();
        uint8_t byte;

        for (uint8_t taken = 0u; (taken < BYTES_A_TURN) && thenar_uart0_receive(&byte); taken++) {
            thenar_board_receive(byte, now_us);
        }
        thenar_joints_attend(now_us);
        if (thenar_due(now_us)) {
            thenar_keys_attend(now_us);
            scan(thenar_clock_us());
        }
        thenar_reset_watched();
    }
}

/* A turn of a board that recognises; described in thenar_turn.h.

   A missing input (a chip that does not reply, joints that do not arrive) is replaced by its mean, and the grasp is
   reported as degraded. Without any input the grasp is unknown.

   thenar 0.1.0, template board/glove_turn.c.j2. */
#include "thenar_turn.h"

#include <string.h>

#include "thenar_glove.h"
#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_debounce.h"
#include "thenar_due.h"
#include "thenar_joints.h"
#include "thenar_keys.h"

/* Bytes taken from the host before checking whether a scan is due: the host may send without pause. */
#define BYTES_A_TURN 16u

#if THENAR_GLOVE_PORTS > THENAR_BITMAP_BYTES
#error "the classifier's ports are more than the bytes of the board's keys"
#endif

static thenar_glove glove;

/* The inputs available at the last scan: keys, and joints. */
static uint8_t known_before[THENAR_BITMAP_BYTES];
static bool joints_before = true;
#define NOT_YET 0xFFFFu
static uint16_t switches_lost = NOT_YET; /* switches */

/* Copy the closed keys to the classifier: the bytes of its ports are the first of the bitmap. */
static void show(const uint8_t *closed)
{
    (void)memcpy(glove.input.switches, closed, THENAR_GLOVE_PORTS);
}

static bool is_known(uint16_t number, const uint8_t *known)
{
    const uint16_t key = number;

    return (known[key >> 3] & (uint8_t)(1u << (key & 7u))) != 0u;
}

/* Mark the missing inputs in the classifier, if they have changed. */
static void lose(const uint8_t *known, bool joints)
{
    if ((switches_lost == NOT_YET) || (memcmp(known, known_before, sizeof known_before) != 0)) {
        (void)memcpy(known_before, known, sizeof known_before);
        switches_lost = 0u;
        for (uint16_t number = 0u; number < THENAR_GLOVE_SWITCHES; number++) {
            const bool lost = !is_known(number, known);

            switches_lost = (uint16_t)(switches_lost + (lost ? 1u : 0u));
            thenar_glove_lose_switch(&glove, (thenar_glove_switch)number, lost);
        }
    }
    if (joints != joints_before) {
        joints_before = joints;
        for (uint16_t joint = 0u; joint < THENAR_GLOVE_JOINTS; joint++) {
            thenar_glove_lose_joint(&glove, joint, !joints);
        }
    }
}

static void tell_grasp(uint8_t grasp, uint32_t now_us)
{
    const bool degraded = !joints_before || (switches_lost > 0u);
    const bool nothing = !joints_before && (switches_lost == THENAR_GLOVE_SWITCHES);

    if (nothing || (grasp == THENAR_NO_GRASP)) {
        thenar_board_grasp(THENAR_NO_GRASP, 0u, THENAR_GRASP_DEGRADED, now_us);
    } else {
        const uint8_t held = grasp;
        const uint8_t flags = degraded ? THENAR_GRASP_DEGRADED : 0u;

        thenar_board_grasp(held, thenar_glove_margin(&glove), flags, now_us);
    }
}

static void scan(uint32_t now_us)
{
    uint8_t closed[THENAR_BITMAP_BYTES];
    uint8_t known[THENAR_BITMAP_BYTES];
    (void)thenar_keys_scan(closed, known);
    const bool joints = thenar_joints_read(&glove, now_us);
    uint8_t grasp;

    thenar_board_found(known);
    thenar_debounce(closed, known, now_us);
    thenar_board_scanned(closed, known, now_us);
    show(closed);
    lose(known, joints);
    grasp = thenar_glove_update(&glove);
    tell_grasp(grasp, now_us);
}

void thenar_turn_begin(void)
{
    thenar_glove_init(&glove);
    thenar_board_boot(thenar_clock_us());
    thenar_keys_begin();
    thenar_joints_begin();
    thenar_due_begin(thenar_clock_us());
}

void thenar_turn(void)
{
    const uint32_t now_us = thenar_clock_us();
    uint8_t byte;

    for (uint8_t taken = 0u; (taken < BYTES_A_TURN) && thenar_port_receive(&byte); taken++) {
        thenar_board_receive(byte, now_us);
    }
    thenar_joints_attend(now_us);
    if (thenar_due(now_us)) {
        thenar_keys_attend(now_us);
        scan(thenar_clock_us());
    }
}

/* A CyberGlove of 18 sensors on UART 1, which streams records: S, a byte a sensor (1 to 255), 00.

   It is stopped, set to send neither time stamps nor its status, set to its rate, and started. After a second of
   silence all of that is repeated. A record is a sequence between two 00 that has the right length; `eg` before its
   end means that no glove is plugged into the box, `es` that it sends at full speed.

   joint 0: byte 1, thumb_rotation
   joint 1: byte 6, index_pij

   thenar 0.1.0, template board/thenar_cyberglove.c.j2. */
#include "thenar_joints.h"

#include <string.h>

#include "thenar_clock.h"
#include "thenar_flash.h"
#include "thenar_uart1.h"

#define SENSORS 18u
#define JOINTS 2u
#define RECORD (1u + SENSORS) /* without its end */
#define FAULTY (RECORD + 2u)  /* with `e` and the fault's letter */
#define BYTES_A_TURN 16u /* bytes taken per turn: the glove may send without pause */
#define LOST_US UINT32_C(16994) /* two periods of the records: an older one is stale */
#define SILENT_US UINT32_C(1000000)
#define PAUSE_US UINT32_C(100000) /* longer than a pending record, and than the box takes to reply */

/* The messages to the box, one per pause. */
typedef struct {
    uint8_t length;
    uint8_t bytes[5];
} message;

static const message messages[] PROGMEM = {
    {1u, {0x03u}},                           /* Ctrl-C: stop */
    {1u, {0x03u}},
    {2u, {'D', 0u}},                         /* no time stamps */
    {2u, {'U', 0u}},                         /* no status byte */
    {5u, {'T', 0x00u, 0x00u, 0x00u, 0x00u}}, /* as fast as it can */
    {1u, {'S'}}                              /* stream */
};

#define MESSAGES (sizeof(messages) / sizeof(messages[0]))

/* The place of each joint in a record. */
static const uint8_t places[JOINTS] PROGMEM = { 1u, 6u };

static uint8_t piece[FAULTY];
static uint8_t size;       /* of the piece; more than FAULTY: too long */
static uint8_t sent;       /* messages sent so far */
static uint32_t active_us;   /* time of the last message sent or record received */
static uint32_t record_us; /* time of the newest record */
static bool fresh;         /* it can be used */
static uint8_t codes[JOINTS]; /* of the newest record */

/* Return whether the piece is a record, with `es` or `eg` before its end or not. */
static bool is_record(void)
{
    const bool faulty = (size == FAULTY) && (piece[RECORD] == (uint8_t)'e')
        && ((piece[RECORD + 1u] == (uint8_t)'s') || (piece[RECORD + 1u] == (uint8_t)'g'));

    return (piece[0] == (uint8_t)'S') && ((size == RECORD) || faulty);
}

/* Process a complete piece. */
static void take_piece(uint32_t now_us)
{
    if (is_record()) {
        active_us = now_us;
        record_us = now_us;
        fresh = (size == RECORD) || (piece[RECORD + 1u] == (uint8_t)'s');
        for (uint8_t at = 0u; fresh && (at < JOINTS); at++) {
            codes[at] = piece[pgm_read_byte(&places[at])];
        }
    }
}

static void take(uint8_t byte, uint32_t now_us)
{
    if (byte == 0u) {
        take_piece(now_us);
        size = 0u;
    } else if (size < FAULTY) {
        piece[size] = byte;
        size++;
    } else {
        size = FAULTY + 1u;
    }
}

/* Send the next message if it is due. */
static void tell(uint32_t now_us)
{
    const uint32_t silent_us = now_us - active_us;
    message next;

    if ((sent == MESSAGES) && (silent_us > SILENT_US)) {
        sent = 0u;
    }
    if ((sent < MESSAGES) && (silent_us > PAUSE_US)) {
        (void)memcpy_P(&next, &messages[sent], sizeof next);
        (void)thenar_uart1_send(next.bytes, next.length);
        sent++;
        active_us = now_us;
    }
}

void thenar_joints_begin(void)
{
    thenar_uart1_begin();
    active_us = thenar_clock_us();
}

void thenar_joints_attend(uint32_t now_us)
{
    uint8_t byte;

    for (uint8_t taken = 0u; (taken < BYTES_A_TURN) && thenar_uart1_receive(&byte); taken++) {
        take(byte, now_us);
    }
    tell(now_us);
}

bool thenar_joints_read(thenar_glove *glove, uint32_t now_us)
{
    (void)memcpy(glove->input.codes, codes, sizeof codes);
    fresh = fresh && ((now_us - record_us) <= LOST_US);
    return fresh;
}

/* A CyberGlove of 18 sensors on UART 1, which streams records: S, a byte a sensor (1 to 255), 00.

   It is made to stop whatever it does, told to add neither time stamps nor its status, how often to send, and then to
   stream. When it is silent for a second, all of that is done again. A record is what lies between two 00, if it has
   the right length; `eg` before its end says that no glove is plugged into the box, `es` that it sends at full speed.

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
#define FAULTY (RECORD + 2u)  /* with `e` and what is wrong */
#define BYTES_A_TURN 16u /* so many are taken before all else has its turn: they may come without end */
#define LOST_US UINT32_C(16994) /* two periods of the records: an older one counts no more */
#define SILENT_US UINT32_C(1000000)
#define PAUSE_US UINT32_C(100000) /* longer than a record that is still on its way, and than the box takes to answer */

/* What the box is told, one message a pause. */
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

/* Where in a record each joint stands. */
static const uint8_t places[JOINTS] PROGMEM = { 1u, 6u };

static uint8_t piece[FAULTY];
static uint8_t size;       /* of the piece; more than FAULTY: too long */
static uint8_t told;       /* messages so far */
static uint32_t told_us;   /* when the last one was sent, or a record came in */
static uint32_t record_us; /* when the newest record came in */
static bool fresh;         /* it is one to go by */
static uint8_t codes[JOINTS]; /* of the newest record */

/* Return whether the piece is a record, with `es` or `eg` before its end or not. */
static bool is_record(void)
{
    const bool faulty = (size == FAULTY) && (piece[RECORD] == (uint8_t)'e')
        && ((piece[RECORD + 1u] == (uint8_t)'s') || (piece[RECORD + 1u] == (uint8_t)'g'));

    return (piece[0] == (uint8_t)'S') && ((size == RECORD) || faulty);
}

/* Take a piece that has ended. */
static void take_piece(uint32_t now_us)
{
    if (is_record()) {
        told_us = now_us;
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

/* Send the next message, when it is time for it. */
static void tell(uint32_t now_us)
{
    const uint32_t silent_us = now_us - told_us;
    message next;

    if ((told == MESSAGES) && (silent_us > SILENT_US)) {
        told = 0u;
    }
    if ((told < MESSAGES) && (silent_us > PAUSE_US)) {
        (void)memcpy_P(&next, &messages[told], sizeof next);
        (void)thenar_uart1_send(next.bytes, next.length);
        told++;
        told_us = now_us;
    }
}

void thenar_joints_begin(void)
{
    thenar_uart1_begin();
    told_us = thenar_clock_us();
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

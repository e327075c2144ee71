/* Frames as datagrams; described in thenar_datagram.h.

   thenar 0.1.0, template board/thenar_datagram.c.j2. */
#include "thenar_datagram.h"

#include <string.h>

#include "thenar_frames.h"

#define MARK 0x54u
#define VERSION 0x01u
#define SESSION_AT 2u
#define NUMBER_AT 6u
#define SILENT_US UINT32_C(2000000)
#define HALF UINT32_C(0x80000000)
#define BITS 32u

static struct {
    uint32_t boot;
    uint32_t session;
    uint32_t number;      /* of the next frame */
    uint32_t heard;       /* the newest number from the host, and a bitmap of earlier ones */
    uint32_t heard_before;
    uint32_t heard_us;    /* its time */
    thenar_peer peer;
    bool attended;        /* a host is connected */
    bool began;           /* a host has connected since boot */
} line;

static uint8_t *put32(uint8_t *to, uint32_t value)
{
    uint32_t left = value;

    for (uint8_t byte = 0u; byte < 4u; byte++) {
        to[byte] = (uint8_t)(left & 0xFFu);
        left >>= 8;
    }
    return &to[4];
}

static uint32_t get32(const uint8_t *from)
{
    return from[0] | ((uint32_t)from[1] << 8) | ((uint32_t)from[2] << 16) | ((uint32_t)from[3] << 24);
}

void thenar_datagram_begin(uint32_t boot)
{
    (void)memset(&line, 0, sizeof line);
    line.boot = boot;
}

/* Drop a host that has been silent for too long. */
static void run_to(uint32_t now_us)
{
    if (line.attended && ((now_us - line.heard_us) >= SILENT_US)) {
        line.attended = false;
    }
}

/* Return whether these bytes are exactly one valid frame. */
static bool is_frame(const uint8_t *bytes, uint16_t size)
{
    thenar_decoder decoder;
    thenar_frame_outcome outcome = THENAR_FRAME_NONE;
    uint16_t at = 0u;

    thenar_decoder_reset(&decoder);
    decoder.piece = 0u;
    while ((at < size) && (bytes[0] != 0u) && (outcome == THENAR_FRAME_NONE)) {
        outcome = thenar_decoder_take(&decoder, bytes[at]);
        at++;
    }
    return (outcome == THENAR_FRAME_GOOD) && (at == size);
}

static bool is_host(const thenar_peer *peer, uint32_t session)
{
    return (session == line.session) && (peer->address == line.peer.address) && (peer->port == line.peer.port);
}

/* Return whether a number is newer than all numbers of the session. */
static bool is_newer(uint32_t session, uint32_t number)
{
    return !line.began || (session != line.session) || ((number != line.heard) && ((number - line.heard) < HALF));
}

/* Record a number that is newer than all before it. */
static void hear(uint32_t session, uint32_t number)
{
    const uint32_t ahead = number - line.heard;

    if (!line.began || (session != line.session) || (ahead > BITS)) {
        line.heard_before = 0u;
    } else if (ahead == BITS) {
        line.heard_before = HALF;
    } else {
        line.heard_before = (line.heard_before << ahead) | (UINT32_C(1) << (ahead - 1u));
    }
    line.began = true;
    line.session = session;
    line.heard = number;
}

/* Take a frame of a host that may become the current one. */
static bool take(const uint8_t *datagram, uint16_t size, const thenar_peer *peer, uint32_t now_us)
{
    const uint32_t session = get32(&datagram[SESSION_AT]);
    const uint32_t number = get32(&datagram[NUMBER_AT]);
    const uint16_t length = (uint16_t)(size - THENAR_DATAGRAM_TO_BOARD);
    bool taken = false;

    if (line.attended && (length == 0u)) {
        line.attended = !is_host(peer, session); /* farewell */
    } else if ((!line.attended || is_host(peer, session)) && is_newer(session, number)
        && is_frame(&datagram[THENAR_DATAGRAM_TO_BOARD], length)) {
        hear(session, number);
        line.peer = *peer;
        line.heard_us = now_us;
        line.attended = true;
        taken = true;
    } else {
        /* another host, or a datagram from long ago */
    }
    return taken;
}

bool thenar_datagram_take(const uint8_t *datagram, uint16_t size, const thenar_peer *peer, uint32_t now_us)
{
    run_to(now_us);
    return (size >= THENAR_DATAGRAM_TO_BOARD) && (size <= THENAR_DATAGRAM_MOST) && (datagram[0] == MARK)
        && (datagram[1] == VERSION) && take(datagram, size, peer, now_us);
}

uint16_t thenar_datagram_wrap(
    uint8_t *datagram, const uint8_t *frame, uint8_t length, thenar_peer *peer, uint32_t now_us)
{
    uint16_t size = 0u;

    run_to(now_us);
    if (length > 1u) { /* on a serial line, a single 00 ends a partial frame: datagrams have none */
        if (line.attended) {
            uint8_t *to = datagram;

            to[0] = MARK;
            to[1] = VERSION;
            to = put32(&to[SESSION_AT], line.session);
            to = put32(to, line.boot);
            to = put32(to, line.number);
            to = put32(to, line.heard);
            to = put32(to, line.heard_before);
            (void)memcpy(to, frame, length);
            *peer = line.peer;
            size = length;
            size = (uint16_t)(size + THENAR_DATAGRAM_TO_HOST);
        }
        line.number++;
    }
    return size;
}

/* The scanner board's protocol, without its line and its keys; described in thenar_board.h, and byte by byte in
   thenar's documentation of the scanner board.

   thenar 0.1.0, template board/thenar_board.c.j2. */
#include "thenar_board.h"

#include "thenar_debounce.h"
#include "thenar_frames.h"
#include "thenar_time.h"

#define PROTOCOL 1u
#define VERSION_MAJOR 1u
#define VERSION_MINOR 0u
#define VERSION_PATCH 0u
#define FLAG_WITHOUT_DIODES 0x01u

#define HELLO 0x01u
#define STATE 0x02u
#define EVENT 0x03u
#define HEARTBEAT 0x04u
#define ERROR 0x05u
#define GRASP 0x06u
#define LOST 0x07u
#define SET_RATE 0x11u
#define SET_DEBOUNCE 0x12u
#define GET_STATE 0x13u
#define PING 0x14u

/* Sizes of payloads. */
#define HELLO_BYTES 35u
#define STATE_BYTES THENAR_BITMAP_BYTES
#define EVENT_BYTES 7u
#define HEARTBEAT_BYTES (4u + THENAR_BITMAP_BYTES)
#define ERROR_BYTES 20u
#define GRASP_BYTES 8u
#define LOST_BYTES THENAR_BITMAP_BYTES

#define ERRORS_EVERY_US UINT32_C(1000000)
#define KEYS_OF_LAST_BYTE (0xFFu >> ((THENAR_BITMAP_BYTES * 8u) - THENAR_KEYS))

/* A frame's length is a byte. */
#if THENAR_KEYS > 1960
#error "a board has at most 1960 keys"
#endif

/* The longest that the board sends is a HELLO, or a HEARTBEAT of many keys. */
#if HEARTBEAT_BYTES > HELLO_BYTES
#define BUFFER_BYTES (THENAR_FRAME_OVERHEAD + HEARTBEAT_BYTES)
#else
#define BUFFER_BYTES (THENAR_FRAME_OVERHEAD + HELLO_BYTES)
#endif

/* A periodic message: due at every whole period since it was last set. */
typedef struct {
    uint32_t period_us;  /* 0: never */
    uint32_t passed_us;  /* since the last whole period, less than one */
    bool due;
} schedule;

typedef struct {
    uint32_t time_us;  /* time of the last call */
    uint32_t scan_us;
    schedule state;
    schedule heartbeat;
    uint32_t error_in_us;  /* time until an ERROR may be sent */
    uint32_t overruns;
    uint32_t refused;
    uint32_t dropped;
    uint32_t bus;
    uint16_t press_us;
    uint16_t release_us;
    bool news;         /* a count has grown since the last ERROR */
    bool tell_grasp;   /* report the next one, even if unchanged */
    uint8_t grasp;     /* the last one reported */
    uint8_t degraded;
    uint8_t sequence;
    bool scanned;      /* all keys, at least once */
    bool loses;        /* there are lost keys */
    uint8_t closed[THENAR_BITMAP_BYTES];
    uint8_t lost[THENAR_BITMAP_BYTES];
} board_state;

static board_state board;
static thenar_decoder decoder;
static uint8_t buffer[BUFFER_BYTES];

/* Little-endian, into the buffer and from received bytes. */

static uint8_t *put16(uint8_t *to, uint16_t value)
{
    to[0] = (uint8_t)(value & 0xFFu);
    to[1] = (uint8_t)(value >> 8);
    return &to[2];
}

static uint8_t *put32(uint8_t *to, uint32_t value)
{
    return put16(put16(to, (uint16_t)(value & 0xFFFFu)), (uint16_t)(value >> 16));
}

static uint16_t get16(const uint8_t *from)
{
    return (uint16_t)(from[0] | ((uint16_t)from[1] << 8));
}

static uint32_t get32(const uint8_t *from)
{
    return get16(from) | ((uint32_t)get16(&from[2]) << 16);
}

/* Schedules */

static void schedule_start(schedule *one, uint32_t period_us)
{
    one->period_us = period_us;
    one->passed_us = 0u;
    one->due = true;
}

static void schedule_run(schedule *one, uint32_t elapsed_us)
{
    if (one->period_us > 0u) {
        const uint32_t left_us = one->period_us - one->passed_us;

        if (elapsed_us < left_us) {
            one->passed_us += elapsed_us;
        } else {
            one->passed_us = (elapsed_us - left_us) % one->period_us;
            one->due = true;
        }
    }
}

static bool schedule_due(const schedule *one)
{
    return (one->period_us > 0u) && one->due;
}

static void run_to(uint32_t now_us)
{
    const uint32_t elapsed_us = thenar_elapsed(&board.time_us, now_us);

    schedule_run(&board.state, elapsed_us);
    schedule_run(&board.heartbeat, elapsed_us);
    board.error_in_us = (elapsed_us < board.error_in_us) ? (board.error_in_us - elapsed_us) : 0u;
}

static void count(uint32_t *what)
{
    (*what)++;
    board.news = true;
}

/* Messages */

/* Where the payload of the next frame is written. */
#define PAYLOAD (&buffer[THENAR_FRAME_PAYLOAD_AT])

/* Send the frame whose payload is in the buffer. A dropped frame uses up its sequence number, so the host notices the
   loss. Return whether it was sent: if not, whatever was due is still due. */
static bool send(uint8_t kind, uint8_t payload_length)
{
    const uint16_t length = thenar_frames_encode(buffer, kind, board.sequence, payload_length);
    const bool sent = thenar_port_send(buffer, (uint8_t)length);

    board.sequence++;
    if (!sent) {
        count(&board.dropped);
    }
    return sent;
}

static void put_bitmap(uint8_t *to, const uint8_t *bitmap)
{
    for (uint16_t byte = 0u; byte < THENAR_BITMAP_BYTES; byte++) {
        to[byte] = bitmap[byte];
    }
}

static void send_hello(uint16_t token, uint32_t now_us)
{
    uint8_t *to = PAYLOAD;

    to[0] = PROTOCOL;
    to[1] = (THENAR_DIODES != 0) ? 0u : FLAG_WITHOUT_DIODES;
    to = put16(&to[2], token);
    to = put32(to, THENAR_BOARD_ID);
    to[0] = VERSION_MAJOR;
    to[1] = VERSION_MINOR;
    to[2] = VERSION_PATCH;
    to = put16(&to[3], THENAR_ROWS);
    to = put16(to, THENAR_COLUMNS);
    to = put32(to, board.scan_us);
    to = put32(to, board.state.period_us);
    to = put32(to, board.heartbeat.period_us);
    to = put16(to, board.press_us);
    to = put16(to, board.release_us);
    (void)put32(to, now_us);
    (void)send(HELLO, HELLO_BYTES);
}

static void send_state(void)
{
    put_bitmap(PAYLOAD, board.closed);
    if (send(STATE, STATE_BYTES)) {
        board.state.due = false;
    }
}

static void send_lost(void)
{
    put_bitmap(PAYLOAD, board.lost);
    (void)send(LOST, LOST_BYTES);
}

static void send_heartbeat(uint32_t now_us)
{
    put_bitmap(put32(PAYLOAD, now_us), board.closed);
    if (send(HEARTBEAT, HEARTBEAT_BYTES)) {
        board.heartbeat.due = false;
        board.tell_grasp = true;
    }
}

/* Send all keys: first LOST if the lost keys changed, or if any are lost before a HEARTBEAT; then the HEARTBEAT. */
static void send_keys(bool lost, bool beats, uint32_t now_us)
{
    if (lost || (beats && board.loses)) {
        send_lost();
    }
    if (beats) {
        send_heartbeat(now_us);
    }
}

static void send_event(uint16_t key, uint8_t edge, uint32_t now_us)
{
    uint8_t *to = put16(put32(PAYLOAD, now_us), key);

    to[0] = edge;
    (void)send(EVENT, EVENT_BYTES);
}

static void send_error(uint32_t now_us)
{
    uint8_t *to = put32(PAYLOAD, now_us);

    to = put32(to, board.overruns);
    to = put32(to, board.refused);
    to = put32(to, board.dropped);
    (void)put32(to, board.bus);
    board.news = false;
    board.error_in_us = ERRORS_EVERY_US;
    (void)send(ERROR, ERROR_BYTES);
}

/* Requests of the host */

/* Return the period closest to the host's request, never shorter than that of its scans; 0: none. */
static uint32_t possible(uint32_t period_us)
{
    return ((period_us > 0u) && (period_us < board.scan_us)) ? board.scan_us : period_us;
}

static void set_rate(const uint8_t *payload)
{
    const uint32_t scan_us = get32(payload);

    board.scan_us = (scan_us < THENAR_FASTEST_US) ? THENAR_FASTEST_US : scan_us;
    schedule_start(&board.state, possible(get32(&payload[4])));
    schedule_start(&board.heartbeat, possible(get32(&payload[8])));
}

static void set_debounce(uint16_t press_us, uint16_t release_us)
{
    board.press_us = press_us;
    board.release_us = release_us;
    thenar_debounce_set(press_us, release_us);
}

/* Return the length of a host message's payload; 0xFF: there is no such message. */
static uint8_t length_of(uint8_t kind)
{
    uint8_t length;

    switch (kind) {
    case SET_RATE:
        length = 12u;
        break;
    case SET_DEBOUNCE:
        length = 4u;
        break;
    case GET_STATE:
        length = 0u;
        break;
    case PING:
        length = 2u;
        break;
    default:
        length = 0xFFu;
        break;
    }
    return length;
}

static void reply(uint8_t kind, const uint8_t *payload, uint32_t now_us)
{
    run_to(now_us);
    if (kind == GET_STATE) {
        send_keys(false, board.scanned, now_us); /* before the first scan, that scan sends the reply */
    } else if (kind == PING) {
        send_hello(get16(payload), now_us);
    } else {
        if (kind == SET_RATE) {
            set_rate(payload);
        } else {
            set_debounce(get16(payload), get16(&payload[2]));
        }
        send_hello(0u, now_us);
    }
}

void thenar_board_receive(uint8_t byte, uint32_t now_us)
{
    const thenar_frame_outcome outcome = thenar_decoder_take(&decoder, byte);

    if (outcome == THENAR_FRAME_GOOD) {
        const uint8_t kind = decoder.body[0];

        if (thenar_decoder_payload(&decoder) == length_of(kind)) {
            reply(kind, &decoder.body[2], now_us);
        } else {
            count(&board.refused);
        }
    } else if (outcome != THENAR_FRAME_NONE) {
        count(&board.refused);
    } else {
        /* in the middle of a frame */
    }
}

/* Events from the port */

void thenar_board_boot(uint32_t now_us)
{
    static const uint8_t end = 0u;

    board.time_us = now_us;
    board.scan_us = THENAR_SCAN_US;
    schedule_start(&board.state, THENAR_STATE_US);
    schedule_start(&board.heartbeat, THENAR_HEARTBEAT_US);
    board.error_in_us = 0u;
    board.overruns = 0u;
    board.refused = 0u;
    board.dropped = 0u;
    board.bus = 0u;
    board.news = false;
    board.tell_grasp = false;
    board.grasp = THENAR_NO_GRASP;
    board.degraded = 0u;
    board.sequence = 0u;
    board.scanned = false;
    board.loses = false;
    for (uint16_t byte = 0u; byte < THENAR_BITMAP_BYTES; byte++) {
        board.closed[byte] = 0u;
        board.lost[byte] = 0u;
    }
    thenar_decoder_reset(&decoder);
    thenar_debounce_boot();
    set_debounce(THENAR_PRESS_US, THENAR_RELEASE_US);

    (void)thenar_port_send(&end, 1u);
    send_hello(0u, now_us);
}

void thenar_board_found(const uint8_t *known_bitmap)
{
    for (uint16_t byte = 0u; byte < THENAR_BITMAP_BYTES; byte++) {
        thenar_debounce_forget(byte, (uint8_t)(board.lost[byte] & known_bitmap[byte]));
    }
}

/* Update which of eight keys are lost, and return whether that changed. */
static bool lose(uint16_t byte, uint8_t lost)
{
    const bool changed = board.lost[byte] != lost;

    board.lost[byte] = lost;
    board.loses = board.loses || (lost != 0u);
    return changed;
}

/* Take eight keys, and send an EVENT for each that changed, if EVENTs are requested and it is not the first scan. */
static void take(uint16_t byte, uint8_t closed, uint32_t now_us)
{
    const uint8_t changed = (uint8_t)(board.closed[byte] ^ closed);
    uint8_t mask = 1u;

    board.closed[byte] = closed;
    if ((changed != 0u) && (board.state.period_us == 0u) && board.scanned) {
        for (uint8_t bit = 0u; bit < 8u; bit++) {
            if ((changed & mask) != 0u) {
                send_event((uint16_t)((byte * 8u) + bit), ((closed & mask) != 0u) ? 1u : 0u, now_us);
            }
            mask = (uint8_t)(mask << 1);
        }
    }
}

/* Take the keys and send the messages that are due. The first call sends all keys. */
static void take_all(const uint8_t *closed_bitmap, const uint8_t *known_bitmap, uint32_t now_us)
{
    bool news = false;

    board.loses = false;
    for (uint16_t byte = 0u; byte < THENAR_BITMAP_BYTES; byte++) {
        const uint8_t there = (uint8_t)((byte == (THENAR_BITMAP_BYTES - 1u)) ? KEYS_OF_LAST_BYTE : 0xFFu);
        const uint8_t unread = (uint8_t)(there & (uint8_t)~known_bitmap[byte]);
        const uint8_t read = (uint8_t)(there & known_bitmap[byte]);

        take(byte, (uint8_t)((closed_bitmap[byte] & read) | (board.closed[byte] & unread)), now_us);
        news = lose(byte, unread) || news;
    }
    if (schedule_due(&board.state)) {
        send_state();
    }
    send_keys(news, !board.scanned || schedule_due(&board.heartbeat), now_us);
    board.scanned = true;
}

void thenar_board_scanned(const uint8_t *closed_bitmap, const uint8_t *known_bitmap, uint32_t now_us)
{
    run_to(now_us);
    take_all(closed_bitmap, known_bitmap, now_us);
    if (board.news && (board.error_in_us == 0u)) {
        send_error(now_us);
    }
}

void thenar_board_grasp(uint8_t grasp, uint16_t margin, uint8_t flags, uint32_t now_us)
{
    const uint8_t degraded = (uint8_t)(flags & THENAR_GRASP_DEGRADED);

    if (board.tell_grasp || (grasp != board.grasp) || (degraded != board.degraded)) {
        uint8_t *to = put32(PAYLOAD, now_us);

        to[0] = grasp;
        to = put16(&to[1], margin);
        to[0] = flags;
        board.grasp = grasp;
        board.degraded = degraded;
        board.tell_grasp = !send(GRASP, GRASP_BYTES);
    }
}

void thenar_board_bus_fault(void)
{
    count(&board.bus);
}

void thenar_board_overrun(void)
{
    count(&board.overruns);
}

uint32_t thenar_board_scan_us(void)
{
    return board.scan_us;
}

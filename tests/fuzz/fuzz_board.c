/* Throws bytes at the frame decoder and at the board's C, as a line would; the sanitizers watch, and whatever the board
   sends must be a sound frame. Bytes go to the board one by one; each 00 also ends a scan, whose keys and time are what
   came last.

   clang -fsanitize=fuzzer,address,undefined fuzz_board.c thenar_*.c */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "thenar_board.h"
#include "thenar_debounce.h"
#include "thenar_frames.h"

static bool full;
static unsigned sent;
static uint8_t last_kind;

static void check(bool holds)
{
    if (!holds) {
        abort();
    }
}

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    thenar_decoder decoder;

    thenar_decoder_reset(&decoder);
    for (uint8_t at = 0; at < length; at++) {
        const thenar_frame_outcome outcome = thenar_decoder_take(&decoder, frame[at]);

        check((outcome == THENAR_FRAME_GOOD) == ((at + 1 == length) && (length > 1)));
    }
    sent++;
    last_kind = decoder.body[0];
    return !full;
}

/* Decode all of it; then a sound frame, which must come out. */
static void decode(const uint8_t *data, size_t size)
{
    uint8_t frame[THENAR_FRAME_OVERHEAD] = {0};
    const uint16_t length = thenar_frames_encode(frame, 0x13, 7, 0);
    thenar_frame_outcome outcome = THENAR_FRAME_NONE;
    thenar_decoder decoder;

    thenar_decoder_reset(&decoder);
    for (size_t at = 0; at < size; at++) {
        outcome = thenar_decoder_take(&decoder, data[at]);
        check((outcome == THENAR_FRAME_NONE) || (data[at] == 0));
    }
    (void)thenar_decoder_take(&decoder, 0);
    for (uint16_t at = 0; at < length; at++) {
        outcome = thenar_decoder_take(&decoder, frame[at]);
    }
    check((outcome == THENAR_FRAME_GOOD) && (thenar_decoder_payload(&decoder) == 0));
    check((decoder.body[0] == 0x13) && (decoder.body[1] == 7));
}

static void scan(uint32_t seed, uint32_t now_us)
{
    uint8_t keys[THENAR_BITMAP_BYTES];
    uint8_t known[THENAR_BITMAP_BYTES];

    for (size_t byte = 0; byte < THENAR_BITMAP_BYTES; byte++) {
        keys[byte] = (uint8_t)(seed >> (byte % 4 * 8));
        known[byte] = (uint8_t)~(seed >> ((byte + 1) % 4 * 8));
    }
    thenar_board_found(known);
    thenar_debounce(keys, known, now_us);
    thenar_board_scanned(keys, known, now_us);
    thenar_board_grasp((uint8_t)seed, (uint16_t)(seed >> 8), (uint8_t)(seed & 3), now_us);
    full = (seed & 7) == 7;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    /* After a 00 that ends whatever came: PING 0x1234. */
    static const uint8_t ping[] = {0x00, 0x07, 0x14, 0x01, 0x34, 0x12, 0x99, 0x84, 0x00};
    uint32_t seed = 0;
    uint32_t now_us = UINT32_MAX - 100000;

    decode(data, size);
    full = false;
    thenar_board_boot(now_us);
    for (size_t at = 0; at < size; at++) {
        seed = (seed << 8) | data[at];
        thenar_board_receive(data[at], now_us);
        if (data[at] == 0) {
            now_us += seed >> 12;
            scan(seed >> 8, now_us);
        }
    }
    full = false;
    for (size_t at = 0; at < sizeof ping; at++) {
        sent = 0;
        thenar_board_receive(ping[at], now_us);
    }
    check((sent == 1) && (last_kind == 0x01));
    return 0;
}

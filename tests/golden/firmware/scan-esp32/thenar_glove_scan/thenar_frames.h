/* Frames of the switch-scanner board: type | sequence | payload | CRC-16, stuffed by COBS, ended by 00.

   The CRC is CRC-16/CCITT-FALSE, high byte first. The code only converts bytes and frames: it has no line, and only the
   caller's memory.

   thenar 0.1.0, template board/thenar_frames.h.j2. */
#ifndef THENAR_FRAMES_H
#define THENAR_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

/* The length of a frame on the wire beyond its payload, and the payload's offset before encoding. */
#define THENAR_FRAME_OVERHEAD 6u
#define THENAR_FRAME_PAYLOAD_AT 3u

/* The payload bytes that a decoder keeps: those of SET_RATE, the longest from a host. */
#ifndef THENAR_FRAME_KEPT
#define THENAR_FRAME_KEPT 12u
#endif

/* Encode the frame whose payload of `payload_length` bytes (at most 250) is in `frame` from THENAR_FRAME_PAYLOAD_AT on.
   Return its length on the wire, the payload's and THENAR_FRAME_OVERHEAD. */
uint16_t thenar_frames_encode(uint8_t *frame, uint8_t kind, uint8_t sequence, uint8_t payload_length);

/* The result of taking a byte: the kind of piece that it ended. */
typedef enum {
    THENAR_FRAME_NONE,     /* nothing */
    THENAR_FRAME_GOOD,     /* a frame */
    THENAR_FRAME_DAMAGED,  /* its stuffing or its CRC is wrong */
    THENAR_FRAME_SHORT,    /* less than a frame without payload */
    THENAR_FRAME_OVERLONG  /* more than the longest frame */
} thenar_frame_outcome;

/* body: type, sequence, payload. After GOOD, the payload's length is thenar_decoder_payload(); bytes that do not fit in
   the body are left out. The other members are private. */
typedef struct {
    uint8_t body[2u + THENAR_FRAME_KEPT];
    uint8_t size;    /* of the body and its CRC so far */
    uint8_t piece;   /* bytes since the last 00, at most 255 */
    uint8_t block;   /* bytes still missing from the COBS block */
    bool overlong;
    uint16_t crc;
} thenar_decoder;

/* Discard all bytes received. */
void thenar_decoder_reset(thenar_decoder *decoder);

/* Take a byte and return the kind of piece that it ended. The body is valid until the next byte. */
thenar_frame_outcome thenar_decoder_take(thenar_decoder *decoder, uint8_t byte);

/* Return the length of the payload of a good frame. */
uint8_t thenar_decoder_payload(const thenar_decoder *decoder);

#endif

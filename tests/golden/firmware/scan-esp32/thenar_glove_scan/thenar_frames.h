/* Frames of the switch-scanner board: type | sequence | payload | CRC-16, stuffed by COBS, ended by 00.

   The CRC is CRC-16/CCITT-FALSE, high byte first. Bytes in, frames out, and back; no line, no memory but the caller's.

   thenar 0.1.0, template board/thenar_frames.h.j2. */
#ifndef THENAR_FRAMES_H
#define THENAR_FRAMES_H

#include <stdbool.h>
#include <stdint.h>

/* A frame on the wire is so much longer than its payload, which stands at this place in it until it is encoded. */
#define THENAR_FRAME_OVERHEAD 6u
#define THENAR_FRAME_PAYLOAD_AT 3u

/* How much of a payload a decoder keeps: that of SET_RATE, the longest from a host. */
#ifndef THENAR_FRAME_KEPT
#define THENAR_FRAME_KEPT 12u
#endif

/* Encode the frame whose payload, so many bytes long (at most 250), stands in `frame` from THENAR_FRAME_PAYLOAD_AT on.
   Return its length on the wire, the payload's and THENAR_FRAME_OVERHEAD. */
uint16_t thenar_frames_encode(uint8_t *frame, uint8_t kind, uint8_t sequence, uint8_t payload_length);

/* What a byte that came in has ended. */
typedef enum {
    THENAR_FRAME_NONE,     /* nothing */
    THENAR_FRAME_GOOD,     /* a frame */
    THENAR_FRAME_DAMAGED,  /* its stuffing or its CRC is wrong */
    THENAR_FRAME_SHORT,    /* less than a frame without payload */
    THENAR_FRAME_OVERLONG  /* more than the longest frame */
} thenar_frame_outcome;

/* body: type, sequence, payload. After GOOD, the payload's length is thenar_decoder_payload(), and what does not fit in
   the body was left out. The rest is the decoder's own. */
typedef struct {
    uint8_t body[2u + THENAR_FRAME_KEPT];
    uint8_t size;    /* of the body and its CRC so far */
    uint8_t piece;   /* bytes since the last 00, at most 255 */
    uint8_t block;   /* bytes that are missing from the COBS block */
    bool overlong;
    uint16_t crc;
} thenar_decoder;

/* Forget whatever came in. */
void thenar_decoder_reset(thenar_decoder *decoder);

/* Take a byte and return what it ended. The body holds until the next byte. */
thenar_frame_outcome thenar_decoder_take(thenar_decoder *decoder, uint8_t byte);

/* Return how long the payload of a good frame is. */
uint8_t thenar_decoder_payload(const thenar_decoder *decoder);

#endif

/* Frames of the switch-scanner board; described in thenar_frames.h.

   thenar 0.1.0, template board/thenar_frames.c.j2. */
#include "thenar_frames.h"

#define CRC_START 0xFFFFu
#define SHORTEST_BODY 4u /* type, sequence, CRC */
#define LONGEST_PIECE 255u

/* Extend `crc` by one byte: the polynomial 1021 by shifts, without a table. */
static uint16_t crc_of(uint16_t crc, uint8_t byte)
{
    uint8_t high = (uint8_t)((crc >> 8) ^ byte);

    high = (uint8_t)(high ^ (high >> 4));
    return (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)((uint16_t)high << 12) ^ (uint16_t)((uint16_t)high << 5) ^ high);
}

/* Stuff the bytes from frame[1] up to frame[end]: every zero becomes the distance to the next one, or to the end. */
static void stuff(uint8_t *frame, uint16_t end)
{
    uint16_t code_at = 0u;

    for (uint16_t at = 1u; at < end; at++) {
        if (frame[at] == 0u) {
            frame[code_at] = (uint8_t)(at - code_at);
            code_at = at;
        }
    }
    frame[code_at] = (uint8_t)(end - code_at);
    frame[end] = 0u;
}

uint16_t thenar_frames_encode(uint8_t *frame, uint8_t kind, uint8_t sequence, uint8_t payload_length)
{
    const uint16_t length = payload_length;
    const uint16_t body_end = (uint16_t)(length + THENAR_FRAME_PAYLOAD_AT);
    uint16_t crc = CRC_START;

    frame[1] = kind;
    frame[2] = sequence;
    for (uint16_t at = 1u; at < body_end; at++) {
        crc = crc_of(crc, frame[at]);
    }
    frame[body_end] = (uint8_t)(crc >> 8);
    frame[body_end + 1u] = (uint8_t)(crc & 0xFFu);
    stuff(frame, (uint16_t)(body_end + 2u));
    return (uint16_t)(length + THENAR_FRAME_OVERHEAD);
}

void thenar_decoder_reset(thenar_decoder *decoder)
{
    decoder->size = 0u;
    decoder->piece = 0u;
    decoder->block = 0u;
    decoder->overlong = false;
    decoder->crc = CRC_START;
}

/* Take an unstuffed byte of the body. */
static void keep(thenar_decoder *decoder, uint8_t byte)
{
    if (decoder->size < sizeof decoder->body) {
        decoder->body[decoder->size] = byte;
    }
    decoder->size++;
    decoder->crc = crc_of(decoder->crc, byte);
}

/* Take a byte other than 0 of a piece that is not too long; decoder->piece already counts it. */
static void unstuff(thenar_decoder *decoder, uint8_t byte)
{
    if (decoder->block > 0u) {
        decoder->block--;
        keep(decoder, byte);
    } else {
        /* There is a zero between blocks. (None follows one of 255 bytes, but that fills a piece, and is the last.) */
        if (decoder->piece > 1u) {
            keep(decoder, 0u);
        }
        decoder->block = (uint8_t)(byte - 1u);
    }
}

/* Return the kind of the piece that a 00 has just ended. */
static thenar_frame_outcome outcome_of(const thenar_decoder *decoder)
{
    thenar_frame_outcome outcome = THENAR_FRAME_GOOD;

    if (decoder->piece == 0u) {
        outcome = THENAR_FRAME_NONE;
    } else if (decoder->overlong) {
        outcome = THENAR_FRAME_OVERLONG;
    } else if (decoder->block > 0u) {
        outcome = THENAR_FRAME_DAMAGED;
    } else if (decoder->size < SHORTEST_BODY) {
        outcome = THENAR_FRAME_SHORT;
    } else if (decoder->crc != 0u) {
        outcome = THENAR_FRAME_DAMAGED;
    } else {
        /* a valid frame */
    }
    return outcome;
}

thenar_frame_outcome thenar_decoder_take(thenar_decoder *decoder, uint8_t byte)
{
    thenar_frame_outcome outcome = THENAR_FRAME_NONE;

    if (byte == 0u) {
        outcome = outcome_of(decoder);
        decoder->piece = 0u;
    } else {
        if (decoder->piece == 0u) {
            thenar_decoder_reset(decoder);
        }
        if (decoder->piece == LONGEST_PIECE) {
            decoder->overlong = true;
        } else {
            decoder->piece++;
            unstuff(decoder, byte);
        }
    }
    return outcome;
}

uint8_t thenar_decoder_payload(const thenar_decoder *decoder)
{
    return (uint8_t)(decoder->size - SHORTEST_BODY);
}

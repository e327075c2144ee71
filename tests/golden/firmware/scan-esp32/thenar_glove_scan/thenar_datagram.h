/* One frame per datagram: its header, and the choice of the host.

   From the host: 'T' 01 | session | number | frame. Without a frame it is a farewell.
   From the board: 'T' 01 | session | boot | number | heard | heard before | frame.

   All six are 32 bits, little-endian. The host draws a new session whenever it opens the board, the board a new boot
   number whenever it starts, so datagrams of another host or an earlier run are recognised. Each side counts its
   numbers up; a number is newer than another if it is less than 2^31 ahead of it (RFC 1982). A frame's own number has
   8 bits and cannot order datagrams when more than 128 others may overtake one; the datagram's number continues where
   that one wraps. `heard` is the newest number from the host; `heard before` has bit k set if heard - 1 - k was
   received.

   The code only converts bytes: it uses no network, and no memory but 40 bytes.

   thenar 0.1.0, template board/thenar_datagram.h.j2. */
#ifndef THENAR_DATAGRAM_H
#define THENAR_DATAGRAM_H

#include <stdbool.h>
#include <stdint.h>

/* The offset of the frame, and the maximum length of a datagram. */
#define THENAR_DATAGRAM_TO_BOARD 10u
#define THENAR_DATAGRAM_TO_HOST 22u
#define THENAR_DATAGRAM_MOST (THENAR_DATAGRAM_TO_HOST + 256u)

/* A host: its address, in the port's representation, and its port number. */
typedef struct {
    uint32_t address;
    uint16_t port;
} thenar_peer;

/* Start with a number that the last boot did not have; there is no host yet. */
void thenar_datagram_begin(uint32_t boot);

/* Take a datagram from `peer`; return whether it contains a frame for the board: exactly one valid frame of the current
   host, newer than all before it. The first host with such a frame becomes current, until it says farewell or is silent
   for two seconds; all others are ignored. */
bool thenar_datagram_take(const uint8_t *datagram, uint16_t size, const thenar_peer *peer, uint32_t now_us);

/* Make a datagram of a frame and set its recipient. Return its size; 0: there is no host, so send nothing. */
uint16_t thenar_datagram_wrap(
    uint8_t *datagram, const uint8_t *frame, uint8_t length, thenar_peer *peer, uint32_t now_us);

#endif

/* One frame a datagram: what stands before it, and which host is heard.

   From the host: 'T' 01 | session | number | frame. Without a frame it is a farewell.
   From the board: 'T' 01 | session | boot | number | heard | heard before | frame.

   All six are 32 bits, little-endian. The host draws its session anew whenever it opens the board, the board its boot
   whenever it starts: what another host, or an earlier life, has sent is none of this one's. Numbers count up, each
   side's for itself; a number is newer than another if it is less than 2^31 ahead of it (RFC 1982). The number of a
   frame from the board goes on where its own of 8 bits begins anew: 8 bits do not tell order where more than 128 others
   may overtake a datagram. `heard` is the newest number from the host, `heard before` has bit k set if heard - 1 - k
   came.

   Bytes in, bytes out: no network, no memory but 40 bytes.

   thenar 0.1.0, template board/thenar_datagram.h.j2. */
#ifndef THENAR_DATAGRAM_H
#define THENAR_DATAGRAM_H

#include <stdbool.h>
#include <stdint.h>

/* Where the frame stands, and how long a datagram is at most. */
#define THENAR_DATAGRAM_TO_BOARD 10u
#define THENAR_DATAGRAM_TO_HOST 22u
#define THENAR_DATAGRAM_MOST (THENAR_DATAGRAM_TO_HOST + 256u)

/* A host: its address, however the port has it, and its port. */
typedef struct {
    uint32_t address;
    uint16_t port;
} thenar_peer;

/* Begin, with a number that the last boot did not have: nobody is heard yet. */
void thenar_datagram_begin(uint32_t boot);

/* Take a datagram from `peer`; return whether it holds a frame for the board: one whole, sound frame of the host that
   is heard, newer than all before it. The first host with such a frame is heard until it says farewell, or nothing for
   two seconds; nobody else is. */
bool thenar_datagram_take(const uint8_t *datagram, uint16_t size, const thenar_peer *peer, uint32_t now_us);

/* Make a datagram of a frame, and say whom it is for. Return its size; 0: nobody is heard, and none is to be sent. */
uint16_t thenar_datagram_wrap(
    uint8_t *datagram, const uint8_t *frame, uint8_t length, thenar_peer *peer, uint32_t now_us);

#endif

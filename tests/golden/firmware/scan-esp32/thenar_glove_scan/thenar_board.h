/* The scanner board's protocol, without its line and its keys: messages, and replies (version 1).

   Call everything from one thread, with the board's clock: microseconds, 32 bits, which wraps; two calls must be less
   than 71 minutes apart.

   thenar 0.1.0, template board/thenar_board.h.j2. */
#ifndef THENAR_BOARD_H
#define THENAR_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "thenar_config.h"

/* Bytes of a bitmap of the keys: key k is bit k % 8 of byte k / 8. */
#define THENAR_BITMAP_BYTES ((THENAR_KEYS + 7u) / 8u)

/* Values of thenar_board_grasp: no grasp type was recognised; an input was missing. */
#define THENAR_NO_GRASP 0xFFu
#define THENAR_GRASP_DEGRADED 0x01u

/* Provided by the port: take a whole frame to send, or return false if there is no room for it. */
extern bool thenar_port_send(const uint8_t *frame, uint8_t length);

/* Start, or restart as after a power cut: send an end of frame and HELLO. */
void thenar_board_boot(uint32_t now_us);

/* Take a byte from the host, and reply to a message that it completes. */
void thenar_board_receive(uint8_t byte, uint32_t now_us);

/* Call before a scan is debounced: lost keys that are read again take the state read, not their old one. */
void thenar_board_found(const uint8_t *known_bitmap);

/* Take a scan, debounced, and send the messages that are due: EVENTs or a STATE, LOST, HEARTBEAT, ERROR. `known` are
   the keys that were read; the others keep their state, and are lost. No message about keys is sent before the first
   scan. */
void thenar_board_scanned(const uint8_t *closed_bitmap, const uint8_t *known_bitmap, uint32_t now_us);

/* Take the grasp type of the last scan; margin: best score less the second, in steps, at most 65535. It is sent if the
   grasp type or the degradation differs from the last message, and once after every HEARTBEAT. */
void thenar_board_grasp(uint8_t grasp, uint16_t margin, uint8_t flags, uint32_t now_us);

/* Count a transaction with a port expander that failed; a scan that began late. */
void thenar_board_bus_fault(void);
void thenar_board_overrun(void);

/* Return the period of scans last requested by the host. */
uint32_t thenar_board_scan_us(void);

#endif

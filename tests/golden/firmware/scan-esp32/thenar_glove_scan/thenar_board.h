/* The scanner board without its line and its keys: what it sends when, and what it answers (protocol 1).

   Everything is called from one thread, with the board's clock: microseconds, 32 bits, which wraps; two calls must be
   less than 71 minutes apart.

   thenar 0.1.0, template board/thenar_board.h.j2. */
#ifndef THENAR_BOARD_H
#define THENAR_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "thenar_config.h"

/* Bytes of a bitmap of the keys: key k is bit k % 8 of byte k / 8. */
#define THENAR_BITMAP_BYTES ((THENAR_KEYS + 7u) / 8u)

/* Of thenar_board_grasp: no grasp type was recognised; an input was missing; the scan ended early. */
#define THENAR_NO_GRASP 0xFFu
#define THENAR_GRASP_DEGRADED 0x01u
#define THENAR_GRASP_EARLY 0x02u

/* The port's: take a whole frame to send, or return false if there is no room for it. */
extern bool thenar_port_send(const uint8_t *frame, uint8_t length);

/* Start, or start again, as after a power cut: an end, HELLO. */
void thenar_board_boot(uint32_t now_us);

/* Take a byte from the host, and answer what it completes. */
void thenar_board_receive(uint8_t byte, uint32_t now_us);

/* Before a scan is debounced: lost keys that are read again are to be taken as they are read, not as they were. */
void thenar_board_found(const uint8_t *known_bitmap);

/* Take a scan, debounced, and send what is due: EVENTs or a STATE, LOST, HEARTBEAT, ERROR. `known` are the keys that
   were read; the others keep their state, and are lost if the scan was whole: none was left out on purpose. Nothing is
   sent of keys before the first whole scan. */
void thenar_board_scanned(const uint8_t *closed_bitmap, const uint8_t *known_bitmap, bool whole, uint32_t now_us);

/* Take what was recognised in the last scan; margin: best score less the second, in steps, at most 65535. It is sent if
   it is another grasp type than was told last, or another degradation, and once after every HEARTBEAT. */
void thenar_board_grasp(uint8_t grasp, uint16_t margin, uint8_t flags, uint32_t now_us);

/* Count a transaction with a port expander that failed; a scan that began late. */
void thenar_board_bus_fault(void);
void thenar_board_overrun(void);

/* Return the period of scans, as the host asked for it last. */
uint32_t thenar_board_scan_us(void);

#endif

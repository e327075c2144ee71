/* The configuration of this board: its keys, its number, and its behaviour until the host requests another.

   thenar 0.1.0, template board/thenar_config.h.j2. */
#ifndef THENAR_CONFIG_H
#define THENAR_CONFIG_H

#include <stdint.h>

/* Key k is at row k / THENAR_COLUMNS, column k % THENAR_COLUMNS; keys that are wired directly are one row. */
#define THENAR_ROWS 1u
#define THENAR_COLUMNS 6u
#define THENAR_KEYS 6u

/* 0: the keys are a matrix without diodes, where three closed corners of a rectangle make the fourth look closed. */
#define THENAR_DIODES 1

#define THENAR_BOARD_ID UINT32_C(1)

/* From scan to scan, from STATE to STATE (0: EVENTs instead), from HEARTBEAT to HEARTBEAT (0: none). */
#define THENAR_SCAN_US UINT32_C(1000)
#define THENAR_STATE_US UINT32_C(0)
#define THENAR_HEARTBEAT_US UINT32_C(50000)

/* Debouncing: how long a key is ignored after a press, and how long it must rest open before a release is reported. */
#define THENAR_PRESS_US 0u
#define THENAR_RELEASE_US 0u

/* The lower limit of the scan period that a host can request. */
#define THENAR_FASTEST_US UINT32_C(650)

#endif

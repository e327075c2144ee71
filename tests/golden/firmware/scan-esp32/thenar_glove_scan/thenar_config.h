/* This very board: its keys, its number, and how it works until the host asks for something else.

   thenar 0.1.0, template board/thenar_config.h.j2. */
#ifndef THENAR_CONFIG_H
#define THENAR_CONFIG_H

#include <stdint.h>

/* Key k stands at row k / THENAR_COLUMNS, column k % THENAR_COLUMNS; keys that are wired directly are one row. */
#define THENAR_ROWS 1u
#define THENAR_COLUMNS 6u
#define THENAR_KEYS 6u

/* 0: the keys are a matrix without diodes, where three closed corners of a rectangle close the fourth. */
#define THENAR_DIODES 1

#define THENAR_BOARD_ID UINT32_C(1)

/* From scan to scan, from STATE to STATE (0: EVENTs instead), from HEARTBEAT to HEARTBEAT (0: none). */
#define THENAR_SCAN_US UINT32_C(1000)
#define THENAR_STATE_US UINT32_C(0)
#define THENAR_HEARTBEAT_US UINT32_C(50000)

/* Debouncing: for so long after a press a key is not looked at; so long it rests open before a release is told. */
#define THENAR_PRESS_US 0u
#define THENAR_RELEASE_US 0u

/* No host can make it scan more often than this. */
#define THENAR_FASTEST_US UINT32_C(250)

#endif

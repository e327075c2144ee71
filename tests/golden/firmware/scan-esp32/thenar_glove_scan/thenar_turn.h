/* A scanner board. It reads switches on pins, and sends them to the host (protocol 1 of thenar's scanner board).

   thenar 0.1.0, template board/thenar_turn.h.j2. */
#ifndef THENAR_TURN_H
#define THENAR_TURN_H

#include <stdbool.h>
#include <stdint.h>

/* Provided by the port: put the oldest byte received from the host into *byte; return false if there is none. */
extern bool thenar_port_receive(uint8_t *byte);

/* Start; call it after starting line and clock. */
void thenar_turn_begin(void);

/* Process some of the host's bytes, and scan if that is due. Call it in a loop. */
void thenar_turn(void);

#endif

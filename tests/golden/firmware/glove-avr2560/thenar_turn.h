/* A glove that recognises by itself. It reads switches on port expanders, and tells the host of them and of the
   grasp type (protocol 1 of thenar's scanner board).

   thenar 0.1.0, template board/thenar_turn.h.j2. */
#ifndef THENAR_TURN_H
#define THENAR_TURN_H

#include <stdbool.h>
#include <stdint.h>

/* The port's: put the oldest byte that came in from the host into *byte; return false if there is none. */
extern bool thenar_port_receive(uint8_t *byte);

/* Begin, after line and clock have begun. */
void thenar_turn_begin(void);

/* Take some of the host's bytes, and scan if that is due. It is to be called over and over. */
void thenar_turn(void);

#endif

/* A scanner board. It reads switches on pins, and sends them to the host (protocol 1 of thenar's scanner board).

   README.md, in the folder above, describes how to flash it. The .c files are portable and the same on every board;
   the .cpp files call Arduino's core.

   thenar 0.1.0, template sketch/NAME.ino.j2. */
#include "thenar_line.h"

extern "C" {
#include "thenar_clock.h"
#include "thenar_turn.h"
}

void setup()
{
    thenar_line_begin();
    thenar_clock_begin();
    thenar_turn_begin();
}

void loop()
{
    thenar_turn();
}

/* Early exit of a scan: it may stop when no state of the unread switches, open, closed or lost, could change the grasp
   type.

   thenar 0.1.0, template board/thenar_NAME_decided.h.j2. */
#ifndef THENAR_GLOVE_DECIDED_H
#define THENAR_GLOVE_DECIDED_H

#include "thenar_glove.h"

#define THENAR_GLOVE_SCANNED_PORTS 2u

/* Return whether the ports after `port` (numbered from 0, in the order in which they are read) can be left out.

   leader: the result of classify or update with the switches of the ports up to this one as they were read, and those
   of all later ports open. No input is missing. After the last port the result is true.

   port 0: switches 4, 5
   port 1: switches 0, 1, 2, 3
*/
bool thenar_glove_decided(
    const thenar_glove *glove, uint8_t port, thenar_glove_class leader);

#endif

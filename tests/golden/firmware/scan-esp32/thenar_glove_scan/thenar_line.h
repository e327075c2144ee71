/* The line to the host: datagrams in a Wi-Fi.

   thenar 0.1.0, template sketch/thenar_line.h.j2. */
#ifndef THENAR_LINE_H
#define THENAR_LINE_H

/* Start the line; thenar_port_send() of thenar_board.h and thenar_port_receive() of thenar_turn.h then send and
   receive. */
void thenar_line_begin();

#endif

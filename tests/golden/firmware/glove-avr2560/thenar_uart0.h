/* UART 0 at 1000000 baud (off by +0.0%), by interrupts, 8 data bits, no parity, one stop bit.

   thenar 0.1.0, template board/thenar_uart.h.j2. */
#ifndef THENAR_UART0_H
#define THENAR_UART0_H

#include <stdbool.h>
#include <stdint.h>

/* Set the rate and start to receive. */
void thenar_uart0_begin(void);

/* Send all bytes, or none if there is not enough room: then return false. */
bool thenar_uart0_send(const uint8_t *bytes, uint8_t length);

/* Put the oldest byte received into *byte; return false if there is none. */
bool thenar_uart0_receive(uint8_t *byte);

#endif

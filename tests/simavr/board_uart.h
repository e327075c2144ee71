/* UARTs of the AVR, each on a pty that any serial client opens under a name of its own. */
#ifndef THENAR_BOARD_UART_H
#define THENAR_BOARD_UART_H

#include <stdbool.h>
#include <stdio.h>

#include "harness.h"

/* Give UART `number` a pty with the link `link`, or join it to the port that `link` already is. Bytes from the client
 * reach the AVR at `baud`, ten bits each; what the AVR sends while nobody has the port open is lost, as on a wire. */
void uart_add(avr_t *avr, uint8_t number, uint32_t baud, const char *link, bool joined);

/* Carry what has come from clients to the AVR, and what the AVR has sent to clients. Call it often. */
void uart_carry(void);

/* Take the port away, as a pulled plug does, or put a new one under the same link. False: there is no such UART. */
bool uart_plug(uint8_t number, bool plugged);
void uart_unlink(void);

/* Bytes that the AVR has sent on UART 0 since the last zero. */
uint32_t uart_in_frame(void);

/* Send a byte that the AVR did not, as a transmitter does that loses its power. */
void uart_glitch(uint8_t byte);

/* Print `"uart0": "/path", "uart1": ...`. */
void uart_names(FILE *to);

#endif

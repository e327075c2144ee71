/* Rings of bytes between the program and the interrupts of UART 1.

   Bytes that find no room, or whose stop bit is missing, are dropped: their frame is then invalid.

   thenar 0.1.0, template avr/thenar_uart.c.j2. */
#include "thenar_uart1.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define RECEIVED_BYTES 128u  /* powers of two, at most 256 */
#define SENT_BYTES 16u
#define RECEIVED_MASK (RECEIVED_BYTES - 1u)
#define SENT_MASK (SENT_BYTES - 1u)

/* In each ring, head is the place of the next byte in and tail of the next byte out; equal means empty. */
static volatile uint8_t received[RECEIVED_BYTES];
static volatile uint8_t received_head;
static volatile uint8_t received_tail;
static volatile uint8_t sent[SENT_BYTES];
static volatile uint8_t sent_head;
static volatile uint8_t sent_tail;

ISR(USART1_RX_vect)
{
    const uint8_t head = received_head;
    const uint8_t next = (uint8_t)((head + 1u) & RECEIVED_MASK);
    const uint8_t fault = (uint8_t)(UCSR1A & _BV(FE1));
    const uint8_t byte = UDR1;

    if ((fault == 0u) && (next != received_tail)) {
        received[head] = byte;
        received_head = next;
    }
}

ISR(USART1_UDRE_vect)
{
    const uint8_t tail = sent_tail;

    if (tail == sent_head) {
        UCSR1B &= (uint8_t)~_BV(UDRIE1);
    } else {
        UDR1 = sent[tail];
        sent_tail = (uint8_t)((tail + 1u) & SENT_MASK);
    }
}

void thenar_uart1_begin(void)
{
    PORTD |= _BV(PD2); /* an undriven line must idle high */
    UBRR1 = 16u;
    UCSR1A = _BV(U2X1);
    UCSR1C = _BV(UCSZ11) | _BV(UCSZ10);
    UCSR1B = _BV(RXCIE1) | _BV(RXEN1) | _BV(TXEN1);
}

bool thenar_uart1_send(const uint8_t *bytes, uint8_t length)
{
    uint8_t head = sent_head;
    const uint8_t waiting = (uint8_t)((uint8_t)(head - sent_tail) & SENT_MASK);
    const bool fits = ((uint16_t)waiting + length) <= SENT_MASK;

    if (fits) {
        for (uint8_t at = 0u; at < length; at++) {
            sent[head] = bytes[at];
            head = (uint8_t)((head + 1u) & SENT_MASK);
        }
        sent_head = head;
        UCSR1B |= _BV(UDRIE1);
    }
    return fits;
}

bool thenar_uart1_receive(uint8_t *byte)
{
    const uint8_t tail = received_tail;
    const bool there = tail != received_head;

    if (there) {
        *byte = received[tail];
        received_tail = (uint8_t)((tail + 1u) & RECEIVED_MASK);
    }
    return there;
}

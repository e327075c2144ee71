/* Rings of bytes between the program and the interrupts of UART 0.

   Bytes that find no room, or whose stop bit is missing, are dropped: their frame is then invalid.

   thenar 0.1.0, template avr/thenar_uart.c.j2. */
#include "thenar_uart0.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define RECEIVED_BYTES 128u  /* powers of two, at most 256 */
#define SENT_BYTES 256u
#define RECEIVED_MASK (RECEIVED_BYTES - 1u)
#define SENT_MASK (SENT_BYTES - 1u)

/* In each ring, head is the place of the next byte in and tail of the next byte out; equal means empty. */
static volatile uint8_t received[RECEIVED_BYTES];
static volatile uint8_t received_head;
static volatile uint8_t received_tail;
static volatile uint8_t sent[SENT_BYTES];
static volatile uint8_t sent_head;
static volatile uint8_t sent_tail;

ISR(USART_RX_vect)
{
    const uint8_t head = received_head;
    const uint8_t next = (uint8_t)((head + 1u) & RECEIVED_MASK);
    const uint8_t fault = (uint8_t)(UCSR0A & _BV(FE0));
    const uint8_t byte = UDR0;

    if ((fault == 0u) && (next != received_tail)) {
        received[head] = byte;
        received_head = next;
    }
}

ISR(USART_UDRE_vect)
{
    const uint8_t tail = sent_tail;

    if (tail == sent_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
    } else {
        UDR0 = sent[tail];
        sent_tail = (uint8_t)((tail + 1u) & SENT_MASK);
    }
}

void thenar_uart0_begin(void)
{
    PORTD |= _BV(PD0); /* an undriven line must idle high */
    UBRR0 = 0u;
    UCSR0A = 0u;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

bool thenar_uart0_send(const uint8_t *bytes, uint8_t length)
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
        UCSR0B |= _BV(UDRIE0);
    }
    return fits;
}

bool thenar_uart0_receive(uint8_t *byte)
{
    const uint8_t tail = received_tail;
    const bool there = tail != received_head;

    if (there) {
        *byte = received[tail];
        received_tail = (uint8_t)((tail + 1u) & RECEIVED_MASK);
    }
    return there;
}

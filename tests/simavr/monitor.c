/*
 * A program for the tests of simavr_board: it does to registers and the I2C bus what the serial line says.
 *
 *     p low high            answers the byte at this address
 *     q low high value      writes it, answers the byte that is there then
 *     t address n m bytes   writes n bytes to this chip, then (if m) reads m: answers cycles (2), number of states (1),
 *                           the states of the TWI (TWSR), and what was read (m, only if all went well)
 *     m first last          pulls pins first to last of PORTB low, one at a time, answers PIND, 4 us after each
 *
 * At reset it sends B and MCUSR.
 */
#define F_CPU 16000000UL
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/delay.h>

static uint8_t states[40];
static volatile uint8_t n_states;
static volatile uint8_t busy;
static uint8_t chip, to_write, to_read, place;
static uint8_t bytes[16];

static uint8_t hear(void)
{
    while (!(UCSR0A & _BV(RXC0)))
        ;
    return UDR0;
}

static void say(uint8_t byte)
{
    while (!(UCSR0A & _BV(UDRE0)))
        ;
    UDR0 = byte;
}

/* Interrupts, as Arduino's Wire and our firmware use them. */
ISR(TWI_vect)
{
    uint8_t state = TWSR & 0xF8, control = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);
    states[n_states++] = state;
    switch (state) {
    case 0x08:
    case 0x10:
        TWDR = (uint8_t)(chip << 1 | (to_write == 0));
        break;
    case 0x18:
    case 0x28:
        if (to_write) {
            TWDR = bytes[place++];
            to_write--;
        } else if (to_read) {
            control |= _BV(TWSTA);
            place = 0;
        } else {
            busy = 0;
        }
        break;
    case 0x50:
    case 0x58:
        bytes[place++] = TWDR;
        to_read--;
        busy = to_read != 0;
        break;
    case 0x40:
        place = 0;
        break;
    default:
        busy = 0;
    }
    if (to_read > 1)
        control |= _BV(TWEA);
    TWCR = busy ? control : (control & ~_BV(TWIE)) | _BV(TWSTO);
}

static void transfer(void)
{
    uint16_t cycles;
    uint8_t wanted, at;
    chip = hear();
    to_write = hear();
    wanted = to_read = hear();
    for (at = 0; at < to_write; at++)
        bytes[at] = hear();
    n_states = place = 0;
    busy = 1;
    TCNT1 = 0;
    TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWIE) | _BV(TWSTA);
    while ((busy || TWCR & _BV(TWSTO)) && TCNT1 < 60000)
        ;
    cycles = TCNT1;
    say((uint8_t)cycles);
    say((uint8_t)(cycles >> 8));
    say(n_states);
    for (at = 0; at < n_states; at++)
        say(states[at]);
    for (at = 0; at < wanted && !busy && to_read == 0; at++)
        say(bytes[at]);
    if (busy)
        TWCR = 0;
}

static void matrix(void)
{
    uint8_t row, first = hear(), last = hear(), seen[8];
    for (row = first; row <= last; row++) {
        DDRB = _BV(row);
        _delay_us(4);
        seen[row] = PIND;
        DDRB = 0;
    }
    for (row = first; row <= last; row++)
        say(seen[row]);
}

int main(void)
{
    volatile uint8_t *address;
    uint8_t low;
    UBRR0 = 0; /* 1 Mbaud */
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    TCCR1B = _BV(CS10);
    TWBR = 12; /* 400 kHz */
    sei();
    say('B');
    say(MCUSR);
    MCUSR = 0;
    for (;;) {
        uint8_t command = hear();
        if (command == 't') {
            transfer();
        } else if (command == 'm') {
            matrix();
        } else if (command == 'p' || command == 'q') {
            low = hear();
            address = (volatile uint8_t *)(uint16_t)(low | hear() << 8);
            if (command == 'q')
                *address = hear();
            say(*address);
        }
    }
}

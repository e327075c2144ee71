/* The TWI module's states, one interrupt each (data sheet of the part, "Transmission Modes").

   thenar 0.1.0, template avr/thenar_twi.c.j2. */
#include "thenar_twi.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/twi.h>

#include "thenar_clock.h"

#define TIMEOUT_US UINT32_C(1800)
#define HALF_SCL_CYCLES 80u /* 5 us: the clocks that free the bus run at 100 kHz */
#define RECOVERY_CLOCKS 9u /* a byte and its acknowledgement */

/* The last action of a TWI interrupt: continue, with these additional bits. */
#define GO_ON (_BV(TWINT) | _BV(TWEN) | _BV(TWIE))

/* Shared between program and interrupt, so the compiler must not keep it in registers. */
#define MEMORY_IS_SHARED() __asm__ __volatile__("" ::: "memory")

typedef enum { UNDER_WAY, DONE, REFUSED, FAULTY } outcome;

static struct {
    volatile outcome state;
    uint8_t address;  /* in bits 7 to 1 */
    const uint8_t *written;
    uint8_t to_write;
    uint8_t *read;
    uint8_t to_read;
} transfer;

/* End the transfer, and release the bus. */
static void finish(outcome state)
{
    TWCR = GO_ON | _BV(TWSTO);
    transfer.state = state;
}

/* Request the next byte; the last one is not acknowledged, so that the chip releases SDA. */
static void ask_for_byte(void)
{
    TWCR = (transfer.to_read > 1u) ? (GO_ON | _BV(TWEA)) : GO_ON;
}

static void take_byte(void)
{
    *transfer.read = TWDR;
    transfer.read++;
    transfer.to_read--;
}

/* Send the next byte, or switch to reading, or end. */
static void send_next(void)
{
    if (transfer.to_write > 0u) {
        TWDR = *transfer.written;
        transfer.written++;
        transfer.to_write--;
        TWCR = GO_ON;
    } else if (transfer.to_read > 0u) {
        TWCR = GO_ON | _BV(TWSTA);
    } else {
        finish(DONE);
    }
}

ISR(TWI_vect)
{
    switch (TW_STATUS) {
    case TW_START:
    case TW_REP_START:
        TWDR = (uint8_t)(transfer.address | ((transfer.to_write > 0u) ? TW_WRITE : TW_READ));
        TWCR = GO_ON;
        break;
    case TW_MT_SLA_ACK:
    case TW_MT_DATA_ACK:
        send_next();
        break;
    case TW_MR_SLA_ACK:
        ask_for_byte();
        break;
    case TW_MR_DATA_ACK:
        take_byte();
        ask_for_byte();
        break;
    case TW_MR_DATA_NACK:
        take_byte();
        finish(DONE);
        break;
    case TW_MT_SLA_NACK:
    case TW_MT_DATA_NACK:
    case TW_MR_SLA_NACK:
        finish(REFUSED);
        break;
    default: /* an unexpected START or STOP, or a wrong level: something disturbs the bus */
        finish(FAULTY);
        break;
    }
}

static void take_bus(void)
{
    TWSR = 0u;
    TWBR = 12u;
    TWCR = _BV(TWEN);
}

/* Free a bus on which a chip holds SDA low, in the middle of a byte that was abandoned: clock out the rest of it, and
   send a STOP (UM10204, 3.1.16). */
static void recover(void)
{
    TWCR = 0u;
    /* External resistors pull the bus up, to a voltage that its chips tolerate. */
    PORTD &= (uint8_t)~(_BV(PD1) | _BV(PD0));
    for (uint8_t clock = 0u; clock < RECOVERY_CLOCKS; clock++) {
        DDRD |= _BV(PD0);
        __builtin_avr_delay_cycles(HALF_SCL_CYCLES);
        DDRD &= (uint8_t)~_BV(PD0);
        __builtin_avr_delay_cycles(HALF_SCL_CYCLES);
    }
    DDRD |= _BV(PD0);
    DDRD |= _BV(PD1);
    __builtin_avr_delay_cycles(HALF_SCL_CYCLES);
    DDRD &= (uint8_t)~_BV(PD0);
    __builtin_avr_delay_cycles(HALF_SCL_CYCLES);
    DDRD &= (uint8_t)~_BV(PD1);
    __builtin_avr_delay_cycles(HALF_SCL_CYCLES);
    take_bus();
}

void thenar_twi_begin(void)
{
    recover(); /* a reset may have interrupted a byte from a chip */
}

/* Wait until the transfer has ended, and its STOP is on the wire. */
static outcome ended(void)
{
    const uint32_t began_us = thenar_clock_us();
    outcome state;

    do {
        if ((thenar_clock_us() - began_us) > TIMEOUT_US) {
            return FAULTY;
        }
        state = transfer.state;
    } while ((state == UNDER_WAY) || ((TWCR & _BV(TWSTO)) != 0u));
    return state;
}

bool thenar_twi_transfer(uint8_t address, const uint8_t *written, uint8_t to_write, uint8_t *read, uint8_t to_read)
{
    outcome state;

    transfer.address = (uint8_t)(address << 1);
    transfer.written = written;
    transfer.to_write = to_write;
    transfer.read = read;
    transfer.to_read = to_read;
    transfer.state = UNDER_WAY;
    MEMORY_IS_SHARED();
    TWCR = GO_ON | _BV(TWSTA);
    state = ended();
    MEMORY_IS_SHARED();
    if (state == FAULTY) {
        recover();
    }
    return state == DONE;
}

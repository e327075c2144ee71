#include "board_twi.h"

#include <string.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_twi.h>

#include "board_chips.h"

/* Bits of TWCR. */
enum { TWIE = 0x01, TWEN = 0x04, TWSTO = 0x10, TWSTA = 0x20, TWEA = 0x40, TWINT = 0x80 };

/* Status codes of a master, ATmega328P data sheet, tables 22-2 and 22-3. */
enum {
    STARTED = 0x08, STARTED_AGAIN = 0x10, WRITE_ACK = 0x18, WRITE_NACK = 0x20, SENT_ACK = 0x28, SENT_NACK = 0x30,
    LOST = 0x38, READ_ACK = 0x40, READ_NACK = 0x48, GOT_ACK = 0x50, GOT_NACK = 0x58, NOTHING = 0xF8
};

enum { BYTE_PERIODS = 9, CONDITION_PERIODS = 1 };

static struct {
    avr_t *avr;
    avr_twi_t *registers;
    avr_io_t module;
    bool owned, held, waiting, reads;
    uint8_t next, scl, clocks; /* the bit of SCL in its port, and how many clocks a chip still waits for */
    bool low;
    uint32_t starts;
} twi;

static uint8_t control(void)
{
    return twi.avr->data[twi.registers->r_twcr];
}

static void set_control(uint8_t value)
{
    twi.avr->data[twi.registers->r_twcr] = value;
}

static uint8_t status(void)
{
    return twi.avr->data[twi.registers->r_twsr] & 0xF8;
}

static void set_status(uint8_t value)
{
    uint8_t *place = &twi.avr->data[twi.registers->r_twsr];
    *place = (uint8_t)(value | (*place & 0x03));
}

static avr_cycle_count_t periods(int count)
{
    const uint8_t *data = twi.avr->data;
    return (avr_cycle_count_t)count *
           (16u + 2u * ((uint32_t)data[twi.registers->r_twbr] << 2 * (data[twi.registers->r_twsr] & 3)));
}

static bool is_held(void)
{
    return twi.held || twi.clocks > 0;
}

static avr_cycle_count_t finished(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)when, (void)param;
    twi.reads = false;
    set_status(twi.next);
    avr_raise_interrupt(avr, &twi.registers->twi);
    return 0;
}

static void finish_in(int scl_periods, uint8_t next)
{
    twi.next = next;
    avr_cycle_timer_register(twi.avr, periods(scl_periods), finished, NULL);
}

static void start(int after)
{
    twi.waiting = is_held();
    if (is_held())
        return; /* the bus is busy: the START waits until it is free */
    uint8_t next = twi.owned ? STARTED_AGAIN : STARTED;
    twi.owned = true;
    twi.starts++;
    finish_in(after + CONDITION_PERIODS, next);
}

static avr_cycle_count_t stopped(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr, (void)when, (void)param;
    set_control((uint8_t)(control() & ~TWSTO));
    return 0;
}

static void stop(void)
{
    twi.owned = false;
    set_status(NOTHING);
    avr_cycle_timer_register(twi.avr, periods(CONDITION_PERIODS), stopped, NULL);
}

static void transfer(void)
{
    uint8_t *data = &twi.avr->data[twi.registers->r_twdr], next;
    switch (status()) {
    case STARTED:
    case STARTED_AGAIN: {
        bool acknowledged = chips_start(*data >> 1);
        next = *data & 1 ? (acknowledged ? READ_ACK : READ_NACK) : (acknowledged ? WRITE_ACK : WRITE_NACK);
        break;
    }
    case WRITE_ACK:
    case SENT_ACK:
        next = chips_write(*data) ? SENT_ACK : SENT_NACK;
        break;
    case READ_ACK:
    case GOT_ACK:
        *data = chips_read();
        twi.reads = true;
        next = control() & TWEA ? GOT_ACK : GOT_NACK;
        break;
    default:
        return; /* nothing to do: the flag stays clear, and a program that waits waits for ever, as on the part */
    }
    twi.owned = twi.owned && !is_held();
    finish_in(BYTE_PERIODS, is_held() ? LOST : next);
}

static void switch_off(void)
{
    avr_cycle_timer_cancel(twi.avr, finished, NULL);
    avr_cycle_timer_cancel(twi.avr, stopped, NULL);
    avr_clear_interrupt(twi.avr, &twi.registers->twi);
    twi.owned = twi.waiting = twi.reads = false;
    set_status(NOTHING);
}

static void write_control(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)address, (void)param;
    uint8_t before = control();
    bool flag = before & TWINT && !(value & TWINT);
    set_control((uint8_t)((value & ~(TWINT | TWSTO)) | (before & TWSTO) | (flag ? TWINT : 0)));
    if (!(value & TWEN)) {
        switch_off();
        set_control((uint8_t)(value & ~(TWINT | TWSTO)));
        return;
    }
    if (flag && value & TWIE && !(before & TWIE))
        avr_raise_interrupt(avr, &twi.registers->twi);
    if (!(value & TWINT))
        return;
    avr_clear_interrupt(avr, &twi.registers->twi);
    avr->data[twi.registers->r_twcr] &= (uint8_t)~TWINT;
    if (value & TWSTO) {
        set_control(control() | TWSTO);
        stop();
    }
    if (value & TWSTA)
        start(value & TWSTO ? CONDITION_PERIODS : 0);
    else if (!(value & TWSTO))
        transfer();
}

static void write_status(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = (uint8_t)(status() | (value & 0x03));
}

static void write_data(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = value;
}

static void reset(avr_io_t *module)
{
    (void)module;
    if (twi.reads)
        twi.clocks = BYTE_PERIODS;
    twi.owned = twi.waiting = twi.reads = false;
    twi.avr->data[twi.registers->r_twsr] = NOTHING;
    twi.avr->data[twi.registers->r_twdr] = 0xFF;
}

static void let_go(void)
{
    if (!is_held() && twi.waiting)
        start(0);
}

/* The program moves SCL by itself, as a pin. */
static void clocked(struct avr_irq_t *irq, uint32_t directions, void *param)
{
    (void)irq, (void)param;
    bool low = directions >> twi.scl & 1;
    if (low && !twi.low && twi.clocks > 0)
        twi.clocks--;
    twi.low = low;
    let_go();
}

static void watch_scl(avr_t *avr)
{
    bool is_mega = strcmp(avr->mmcu, "atmega2560") == 0; /* SCL is PD0, on an ATmega328P PC5 */
    twi.scl = is_mega ? 0 : 5;
    avr_irq_t *directions = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(is_mega ? 'D' : 'C'), IOPORT_IRQ_DIRECTION_ALL);
    avr_irq_register_notify(directions, clocked, NULL);
}

static void take(avr_io_addr_t address, avr_io_write_t write)
{
    avr_io_addr_t place = AVR_DATA_TO_IO(address);
    twi.avr->io[place].w.c = write;
    twi.avr->io[place].r.c = NULL;
}

void twi_attach(avr_t *avr)
{
    twi.avr = avr;
    for (avr_io_t *module = avr->io_port; module != NULL; module = module->next)
        if (strcmp(module->kind, "twi") == 0)
            twi.registers = (avr_twi_t *)module;
    if (twi.registers == NULL)
        fail("simavr gives this part no two-wire interface");
    take(twi.registers->r_twcr, write_control);
    take(twi.registers->r_twsr, write_status);
    take(twi.registers->r_twdr, write_data);
    twi.module = (avr_io_t){.kind = "thenar twi", .reset = reset};
    avr_register_io(avr, &twi.module);
    reset(&twi.module);
    watch_scl(avr);
}

void twi_hold(bool held)
{
    twi.held = held;
    let_go();
}

bool twi_reads(void)
{
    return twi.reads;
}

void twi_power(void)
{
    twi.clocks = 0;
}

uint32_t twi_starts(void)
{
    return twi.starts;
}

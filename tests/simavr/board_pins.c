#include "board_pins.h"

#include <stdio.h>
#include <string.h>

#include <simavr/avr_ioport.h>

enum { MOST_PORTS = 12, WIRES = MOST_PORTS * 8, GROUND = WIRES, MOST_KEYS = 2048 };

typedef struct {
    avr_ioport_t *port;
    avr_io_write_t write[3];
    void *param[3];
} wrapped;

typedef struct {
    uint16_t number;
    uint8_t from, to;
    bool diode, closed;
} contact;

static struct {
    avr_t *avr;
    avr_cycle_count_t rise;
    wrapped ports[MOST_PORTS];
    int n_ports;
    contact contacts[MOST_KEYS];
    int n_contacts;
    bool low[WIRES + 1], rising[WIRES];
    avr_cycle_count_t released[WIRES];
    avr_io_t module;
    bool short_told;
} pins;

static bool bit_of(avr_io_addr_t address, int bit)
{
    return pins.avr->data[address] >> bit & 1;
}

static bool drives(int wire, bool level)
{
    const avr_ioport_t *port = pins.ports[wire / 8].port;
    return bit_of(port->r_ddr, wire % 8) && bit_of(port->r_port, wire % 8) == level;
}

/* Mark what is pulled low: `from` where `to` is, and, without a diode, the other way round. */
static bool spread(void)
{
    bool grown = false;
    for (const contact *one = pins.contacts; one < pins.contacts + pins.n_contacts; one++) {
        bool down = one->closed && pins.low[one->to] && !pins.low[one->from];
        bool up = one->closed && !one->diode && pins.low[one->from] && !pins.low[one->to];
        pins.low[one->from] |= down;
        pins.low[one->to] |= up;
        grown |= down || up;
    }
    return grown;
}

static void tell_short(int wire)
{
    if (!pins.short_told)
        fprintf(stderr, "simavr board: short circuit, P%c%d is driven high and pulled low\n",
                pins.ports[wire / 8].port->name, wire % 8);
    pins.short_told = true;
}

/* Find out anew which wires are low, after a pin or a switch has changed. */
static void settle(void)
{
    for (int wire = 0; wire < pins.n_ports * 8; wire++)
        pins.low[wire] = drives(wire, false);
    pins.low[GROUND] = true;
    while (spread())
        ;
    for (int wire = 0; wire < pins.n_ports * 8; wire++) {
        bool rising = !pins.low[wire] && bit_of(pins.ports[wire / 8].port->r_port, wire % 8);
        if (rising && !pins.rising[wire])
            pins.released[wire] = pins.avr->cycle;
        pins.rising[wire] = rising;
        if (pins.low[wire] && drives(wire, true))
            tell_short(wire);
    }
}

/* A wire rises through its pull-up; without one nothing says what it reads: 0 here. */
static bool reads_high(const avr_ioport_t *port, int wire)
{
    bool risen = pins.avr->cycle - pins.released[wire] >= pins.rise || drives(wire, true);
    return !pins.low[wire] && risen && bit_of(port->r_port, wire % 8);
}

static uint8_t read_pins(struct avr_t *avr, avr_io_addr_t address, void *param)
{
    const wrapped *taken = param;
    int first = (int)(taken - pins.ports) * 8;
    uint8_t value = 0;
    for (int bit = 0; bit < 8; bit++)
        value |= (uint8_t)(reads_high(taken->port, first + bit) << bit);
    avr->data[address] = value;
    return value;
}

static void write_port(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    const wrapped *taken = param;
    const avr_io_addr_t registers[] = {taken->port->r_port, taken->port->r_ddr, taken->port->r_pin};
    for (int which = 0; which < 3; which++)
        if (address == registers[which])
            taken->write[which](avr, address, value, taken->param[which]);
    settle();
}

static void take(avr_ioport_t *port)
{
    if (pins.n_ports == MOST_PORTS)
        fail("a part with more than %d ports", MOST_PORTS);
    wrapped *taken = &pins.ports[pins.n_ports++];
    taken->port = port;
    const avr_io_addr_t registers[] = {port->r_port, port->r_ddr, port->r_pin};
    for (int which = 0; which < 3; which++) {
        avr_io_addr_t place = AVR_DATA_TO_IO(registers[which]);
        taken->write[which] = pins.avr->io[place].w.c;
        taken->param[which] = pins.avr->io[place].w.param;
        pins.avr->io[place].w.c = write_port;
        pins.avr->io[place].w.param = taken;
    }
    pins.avr->io[AVR_DATA_TO_IO(port->r_pin)].r.c = read_pins;
    pins.avr->io[AVR_DATA_TO_IO(port->r_pin)].r.param = taken;
}

static void reset(avr_io_t *module)
{
    (void)module;
    settle();
}

void pins_attach(avr_t *avr, uint32_t rise_us)
{
    pins.avr = avr;
    pins.rise = (avr_cycle_count_t)rise_us * avr->frequency / 1000000;
    for (avr_io_t *module = avr->io_port; module != NULL; module = module->next)
        if (strcmp(module->kind, "port") == 0)
            take((avr_ioport_t *)module);
    pins.module = (avr_io_t){.kind = "thenar pins", .reset = reset};
    avr_register_io(avr, &pins.module);
    settle();
}

static uint8_t wire_of(const char *name)
{
    if (strcmp(name, "GND") == 0)
        return GROUND;
    for (int number = 0; number < pins.n_ports; number++)
        if (strlen(name) == 3 && name[1] == pins.ports[number].port->name && name[2] >= '0' && name[2] <= '7')
            return (uint8_t)(number * 8 + name[2] - '0');
    fail("the part has no pin \"%s\"", name);
}

void pins_add(uint16_t key, const char *from, const char *to, bool diode)
{
    if (pins.n_contacts == MOST_KEYS)
        fail("more than %d switches", MOST_KEYS);
    pins.contacts[pins.n_contacts++] = (contact){key, wire_of(from), wire_of(to), diode, false};
}

bool pins_close(uint16_t key, bool closed)
{
    bool found = false;
    for (contact *one = pins.contacts; one < pins.contacts + pins.n_contacts; one++)
        if (one->number == key) {
            one->closed = closed;
            found = true;
        }
    if (found)
        settle();
    return found;
}

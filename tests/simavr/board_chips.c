#include "board_chips.h"

#include <stddef.h>
#include <string.h>

#include "fail.h"

enum { MOST_CHIPS = 16, MOST_KEYS = 512, MOST_PORTS = 3, REGISTERS = 11 };

/* Registers of an MCP230xx, one port's. */
enum { IODIR, IPOL, GPINTEN, DEFVAL, INTCON, IOCON, GPPU, INTF, INTCAP, GPIO, OLAT };
enum { IOCON_BANK = 0x80, IOCON_SEQOP = 0x20 };

/* Register banks of a PCA9555 or TCA6424A. */
enum { INPUT, OUTPUT, POLARITY, CONFIGURATION, BANKS };

typedef struct chip chip;

typedef struct {
    const char *name;
    uint8_t ports, stride;
    void (*reset)(chip *);
    void (*point)(chip *, uint8_t);
    void (*write)(chip *, uint8_t);
    uint8_t (*read)(chip *);
} kind;

struct chip {
    const kind *is;
    uint8_t address;
    bool plugged, pointed;
    uint8_t pointer;
    bool moves;
    uint8_t registers[MOST_PORTS][REGISTERS];
    /* By the switches: pins that are pulled, and those pulled up or down. */
    uint8_t low[MOST_PORTS], high[MOST_PORTS], down[MOST_PORTS];
};

typedef struct {
    uint16_t key;
    chip *at;
    uint8_t pin;
    bool closed_high;
} contact;

static chip chips[MOST_CHIPS];
static int n_chips;
static contact contacts[MOST_KEYS];
static int n_contacts;
static chip *talking;

/* MCP23008 and MCP23017, data sheets DS21919 and DS20001952. */

static void mcp_reset(chip *one)
{
    memset(one->registers, 0, sizeof one->registers);
    for (int port = 0; port < one->is->ports; port++)
        one->registers[port][IODIR] = 0xFF;
}

/* Return port and register of an address; NULL where there is nothing. */
static uint8_t *mcp_register(chip *one, uint8_t address, uint8_t *port)
{
    bool two = one->is->ports == 2, banked = one->registers[0][IOCON] & IOCON_BANK;
    *port = !two ? 0 : banked ? address >> 4 & 1 : address & 1;
    uint8_t number = !two ? address : banked ? address & 0xF : address >> 1;
    return number < REGISTERS ? &one->registers[*port][number] : NULL;
}

static void mcp_advance(chip *one)
{
    bool still = one->registers[0][IOCON] & IOCON_SEQOP, two = one->is->ports == 2;
    bool banked = two && one->registers[0][IOCON] & IOCON_BANK;
    if (still)
        one->pointer ^= two && !banked;
    else
        one->pointer = (uint8_t)((one->pointer + 1) % (!two ? REGISTERS : banked ? 0x1B : 2 * REGISTERS));
}

static void mcp_point(chip *one, uint8_t byte)
{
    one->pointer = byte & 0x1F;
}

static void mcp_write(chip *one, uint8_t byte)
{
    uint8_t port, *place = mcp_register(one, one->pointer, &port);
    if (place == &one->registers[port][IOCON])
        for (int each = 0; each < one->is->ports; each++)
            one->registers[each][IOCON] = byte;
    else if (place == &one->registers[port][GPIO])
        one->registers[port][OLAT] = byte;
    else if (place != NULL && place != &one->registers[port][INTF] && place != &one->registers[port][INTCAP])
        *place = byte;
    mcp_advance(one);
}

/* A pin that nothing pulls floats, and reads 0 here. */
static uint8_t mcp_pins(const chip *one, uint8_t port)
{
    const uint8_t *held = one->registers[port];
    uint8_t seen = (uint8_t)(((held[GPPU] & ~one->low[port] & ~one->down[port]) | one->high[port]) ^ held[IPOL]);
    return (uint8_t)((seen & held[IODIR]) | (held[OLAT] & ~held[IODIR]));
}

static uint8_t mcp_read(chip *one)
{
    uint8_t port, *place = mcp_register(one, one->pointer, &port);
    uint8_t byte = place == NULL ? 0 : place == &one->registers[port][GPIO] ? mcp_pins(one, port) : *place;
    mcp_advance(one);
    return byte;
}

/* PCA9555, TCA9555 (banks of two) and TCA6424A (banks of three, four apart, with auto-increment on request). */

static void banked_reset(chip *one)
{
    memset(one->registers, 0xFF, sizeof one->registers);
    for (int port = 0; port < one->is->ports; port++)
        one->registers[port][POLARITY] = 0;
    one->moves = true;
}

static void banked_point(chip *one, uint8_t byte)
{
    one->pointer = one->is->ports == 2 ? byte & 7 : byte & 0xF;
    one->moves = one->is->ports == 2 || byte & 0x80;
}

static void banked_advance(chip *one)
{
    uint8_t stride = one->is->stride, port = one->pointer % stride;
    if (one->moves)
        one->pointer = (uint8_t)(one->pointer - port + (port + 1) % one->is->ports);
}

static void banked_write(chip *one, uint8_t byte)
{
    uint8_t bank = one->pointer / one->is->stride, port = one->pointer % one->is->stride;
    if (bank != INPUT && port < one->is->ports)
        one->registers[port][bank] = byte;
    banked_advance(one);
}

/* A switch that closes upwards has a resistor to ground, others one upwards. */
static uint8_t banked_pins(const chip *one, uint8_t port)
{
    const uint8_t *held = one->registers[port];
    uint8_t levels = (uint8_t)((~one->low[port] & ~one->down[port]) | one->high[port]);
    uint8_t seen = (uint8_t)((levels & held[CONFIGURATION]) | (held[OUTPUT] & ~held[CONFIGURATION]));
    return seen ^ held[POLARITY];
}

static uint8_t banked_read(chip *one)
{
    uint8_t bank = one->pointer / one->is->stride, port = one->pointer % one->is->stride;
    uint8_t byte = 0;
    if (port < one->is->ports)
        byte = bank == INPUT ? banked_pins(one, port) : one->registers[port][bank];
    banked_advance(one);
    return byte;
}

static const kind kinds[] = {
    {"mcp23008", 1, 0, mcp_reset, mcp_point, mcp_write, mcp_read},
    {"mcp23017", 2, 0, mcp_reset, mcp_point, mcp_write, mcp_read},
    {"pca9555", 2, 2, banked_reset, banked_point, banked_write, banked_read},
    {"tca9555", 2, 2, banked_reset, banked_point, banked_write, banked_read},
    {"tca6424a", 3, 4, banked_reset, banked_point, banked_write, banked_read},
};

static void power_on(chip *one)
{
    one->pointer = 0;
    one->is->reset(one);
}

static chip *chip_at(uint8_t address)
{
    for (chip *one = chips; one < chips + n_chips; one++)
        if (one->address == address)
            return one;
    return NULL;
}

void chips_add(const char *name, uint8_t address)
{
    if (n_chips == MOST_CHIPS)
        fail("more than %d chips", MOST_CHIPS);
    for (size_t number = 0; number < sizeof kinds / sizeof kinds[0]; number++)
        if (strcmp(name, kinds[number].name) == 0) {
            chip *one = &chips[n_chips++];
            *one = (chip){.is = &kinds[number], .address = address, .plugged = true};
            power_on(one);
            return;
        }
    fail("no chip \"%s\" is modelled", name);
}

static void set(const contact *one, bool closed)
{
    uint8_t port = one->pin / 8, bit = (uint8_t)(1u << one->pin % 8);
    uint8_t *pulled = one->closed_high ? &one->at->high[port] : &one->at->low[port];
    *pulled = (uint8_t)(closed ? *pulled | bit : *pulled & ~bit);
    if (one->closed_high)
        one->at->down[port] |= bit;
}

void chips_add_key(uint16_t key, uint8_t address, uint8_t pin, bool closed_high)
{
    chip *at = chip_at(address);
    if (at == NULL || pin >= 8 * at->is->ports || n_contacts == MOST_KEYS)
        fail("key %u: there is no pin %u at 0x%02x", key, pin, address);
    contacts[n_contacts] = (contact){key, at, pin, closed_high};
    set(&contacts[n_contacts++], false);
}

bool chips_close(uint16_t key, bool closed)
{
    bool found = false;
    for (const contact *one = contacts; one < contacts + n_contacts; one++)
        if (one->key == key) {
            set(one, closed);
            found = true;
        }
    return found;
}

bool chips_plug(uint8_t address, bool plugged)
{
    chip *one = chip_at(address);
    if (one != NULL && plugged && !one->plugged)
        power_on(one);
    if (one != NULL)
        one->plugged = plugged;
    return one != NULL;
}

void chips_power(void)
{
    for (chip *one = chips; one < chips + n_chips; one++)
        power_on(one);
}

bool chips_start(uint8_t address)
{
    chip *one = chip_at(address);
    talking = one != NULL && one->plugged ? one : NULL;
    if (talking != NULL)
        talking->pointed = false;
    return talking != NULL;
}

bool chips_write(uint8_t byte)
{
    if (talking == NULL || !talking->plugged)
        return false;
    if (talking->pointed)
        talking->is->write(talking, byte);
    else
        talking->is->point(talking, byte);
    talking->pointed = true;
    return true;
}

uint8_t chips_read(void)
{
    return talking != NULL && talking->plugged ? talking->is->read(talking) : 0xFF;
}

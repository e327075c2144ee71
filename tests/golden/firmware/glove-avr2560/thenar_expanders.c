/* Port expanders on the I2C bus: set up, read, monitored, and set up again after a loss of supply.

   mcp23017 at 0x20
   pca9555 at 0x21

   thenar 0.1.0, template board/thenar_expanders.c.j2. */
#include "thenar_keys.h"

#include <string.h>

#include "thenar_board.h"
#include "thenar_flash.h"
#include "thenar_twi.h"

#define CHIPS 2u
#define PORTS 2u
#define MOST_WRITTEN 7u
#define MOST_READ 6u
#define MOST_PORTS 2u
#define NO_KEY 0xFFu

/* The period of checks of one chip, so that each is checked once a second. */
#define ATTEND_US (UINT32_C(1000000) / CHIPS)

/* A register, the bytes written from it on, and the bytes expected there afterwards, if any. */
typedef struct {
    uint8_t written;
    uint8_t bytes[MOST_WRITTEN];
    uint8_t expected;
    uint8_t reply[MOST_READ];
} chip_write;

static const chip_write writes[] PROGMEM = {
    /* mcp23017 at 0x20 */
    {2u, {0x05u, 0x00u}, 0u, {0x00u}},
    {2u, {0x0Au, 0x04u}, 2u, {0x04u, 0x04u}},
    {7u, {0x00u, 0xFFu, 0xFFu, 0x00u, 0x00u, 0x00u, 0x00u}, 6u, {0xFFu, 0xFFu, 0x00u, 0x00u, 0x00u, 0x00u}},
    {5u, {0x0Au, 0x04u, 0x04u, 0x87u, 0x81u}, 4u, {0x04u, 0x04u, 0x87u, 0x81u}},
    /* pca9555 at 0x21 */
    {3u, {0x06u, 0xFFu, 0xFFu}, 4u, {0xFFu, 0xFFu, 0xFFu, 0xFFu}},
    {3u, {0x04u, 0x00u, 0x00u}, 2u, {0x00u, 0x00u}},
    {3u, {0x02u, 0xAAu, 0x55u}, 2u, {0xAAu, 0x55u}},
};

/* A chip, and the writes that set it up. A supply failure undoes the last of them. */
typedef struct {
    uint8_t address;
    uint8_t first;
    uint8_t last;
} chip_at;

static const chip_at chips[CHIPS] PROGMEM = {
    {0x20u, 0u, 3u}, /* mcp23017 at 0x20 */
    {0x21u, 4u, 6u}, /* pca9555 at 0x21 */
};

/* One reading of a chip: the register and the number of bytes. `high` has the bits that a working chip keeps at 1, and
   `closed_low` is 0xFF where a switch that is closed reads 0. */
typedef struct {
    uint8_t chip;
    uint8_t command;
    uint8_t length;
    uint8_t high[MOST_PORTS];
    uint8_t closed_low;
    uint8_t keys[8u * MOST_PORTS]; /* of the reply's bits */
} port_at;

/* In the order of reading. */
static const port_at ports[PORTS] PROGMEM = {
    /* mcp23017 at 0x20, ports AB: thumb tip, index tip, index middle, middle tip */
    {0u, 0x12u, 2u, {0x80u, 0x80u}, 0xFFu, {
        0x00u, 0x01u, 0x02u, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu,
        0x03u, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu,
    }},
    /* pca9555 at 0x21, port 0: palm radial, palm ulnar */
    {1u, 0x00u, 1u, {0x00u}, 0xFFu, {
        0x04u, 0x05u, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu, 0xFFu,
    }},
};

static bool present[CHIPS];
static uint8_t next_chip;
static uint32_t attended_us;

static bool transfer(uint8_t address, const uint8_t *written, uint8_t to_write, uint8_t *read, uint8_t to_read)
{
    const bool done = thenar_twi_transfer(address, written, to_write, read, to_read);

    if (!done) {
        thenar_board_bus_fault();
    }
    return done;
}

/* Return whether the chip still holds the bytes written. */
static bool holds(uint8_t address, const chip_write *write)
{
    uint8_t reply[MOST_READ];

    return transfer(address, write->bytes, 1u, reply, write->expected)
        && (memcmp(reply, write->reply, write->expected) == 0);
}

/* Configure a chip's pins as inputs, and verify it: an acknowledgement alone is not trusted. */
static void set_up(uint8_t number)
{
    chip_at chip;
    chip_write write;
    bool fine = true;

    (void)memcpy_P(&chip, &chips[number], sizeof chip);
    for (uint8_t at = chip.first; fine && (at <= chip.last); at++) {
        (void)memcpy_P(&write, &writes[at], sizeof write);
        fine = transfer(chip.address, write.bytes, write.written, NULL, 0u)
            && ((write.expected == 0u) || holds(chip.address, &write));
    }
    present[number] = fine;
}

static bool in_order(uint8_t number)
{
    chip_at chip;
    chip_write write;

    (void)memcpy_P(&chip, &chips[number], sizeof chip);
    (void)memcpy_P(&write, &writes[chip.last], sizeof write);
    return holds(chip.address, &write);
}

void thenar_keys_begin(void)
{
    thenar_twi_begin();
    for (uint8_t number = 0u; number < CHIPS; number++) {
        set_up(number);
        if (!present[number]) { /* the disturbance may be over: try again at once */
            set_up(number);
        }
    }
}

void thenar_keys_attend(uint32_t now_us)
{
    if ((now_us - attended_us) >= ATTEND_US) {
        attended_us = now_us;
        if (!present[next_chip] || !in_order(next_chip)) {
            set_up(next_chip);
        }
        next_chip = (uint8_t)((next_chip + 1u) % CHIPS);
    }
}

/* Read a port, twice if needed; a chip that still does not reply is absent. */
static bool replied(const port_at *port, uint8_t *reply)
{
    chip_at chip;
    bool done;

    (void)memcpy_P(&chip, &chips[port->chip], sizeof chip);
    done = transfer(chip.address, &port->command, 1u, reply, port->length)
        || transfer(chip.address, &port->command, 1u, reply, port->length);
    present[port->chip] = done;
    return done;
}

/* Return whether the bits that the chip keeps at 1 are 1; if not, it has lost its registers. */
static bool keeps_high(const port_at *port, const uint8_t *reply)
{
    uint8_t missing = 0u;

    for (uint8_t byte = 0u; byte < port->length; byte++) {
        missing |= (uint8_t)(port->high[byte] & (uint8_t)~reply[byte]);
    }
    return missing == 0u;
}

/* Sort the bits of a reply into the bitmaps. */
static void sort(const port_at *port, const uint8_t *reply, uint8_t *closed, uint8_t *known)
{
    const uint8_t *key = port->keys;

    for (uint8_t byte = 0u; byte < port->length; byte++) {
        uint8_t left = (uint8_t)(reply[byte] ^ port->closed_low);

        for (uint8_t bit = 0u; bit < 8u; bit++) {
            if (*key != NO_KEY) {
                const uint8_t mask = (uint8_t)(1u << (*key & 7u));

                known[*key >> 3] |= mask;
                if ((left & 1u) != 0u) {
                    closed[*key >> 3] |= mask;
                }
            }
            left >>= 1;
            key++;
        }
    }
}

/* Add a reading to both bitmaps, and return whether it succeeded. */
static bool add(uint8_t number, uint8_t *closed, uint8_t *known)
{
    port_at port;
    uint8_t reply[MOST_PORTS];
    bool fine;

    (void)memcpy_P(&port, &ports[number], sizeof port);
    fine = present[port.chip] && replied(&port, reply);
    if (fine && !keeps_high(&port, reply)) {
        set_up(port.chip);
        fine = false;
    }
    if (fine) {
        sort(&port, reply, closed, known);
    }
    return fine;
}

bool thenar_keys_scan(uint8_t *closed, uint8_t *known)
{
    bool fine = true;

    (void)memset(closed, 0, THENAR_BITMAP_BYTES);
    (void)memset(known, 0, THENAR_BITMAP_BYTES);
    for (uint8_t port = 0u; port < PORTS; port++) {
        fine = add(port, closed, known) && fine;
    }
    return fine;
}

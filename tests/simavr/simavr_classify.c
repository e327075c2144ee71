/*
 * Runs one function of an AVR program on frame after frame, and counts its cycles.
 *
 *     simavr_classify MCU HZ ELF FUNCTION FREE INPUT:SIZE OUTPUT:SIZE
 *
 * The program calls the function at the address FUNCTION for ever. Whenever it is entered, SIZE bytes of stdin are put
 * where its input is; whenever it returns, there go to stdout SIZE bytes of its output, what it returned (r24 and r25,
 * two bytes), the cycles from its first instruction to the end of its return (four bytes) and how much stack it took
 * (two bytes), little-endian. The stack is what the function and all that it calls need, its return address included,
 * found by what they leave of a pattern between FREE, the end of the program's data, and the stack pointer.
 *
 * Addresses are as in the ELF file, data from 0x800000 on. Exit code 2: something is wrong, one line on stderr.
 */
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "harness.h"

enum {
    DATA_SPACE = 0x800000,
    RETURNED = 24,         /* where avr-gcc returns 8 and 16 bits */
    MOST_START = 50000000, /* cycles from reset to the first call */
    MOST_CYCLES = 5000000, /* a function that has not come back by then never will */
    LONGEST = 4096,
};

typedef struct {
    uint32_t address, size;
} span;

typedef struct {
    avr_t *avr;
    uint32_t function;
    uint16_t free;
    span input, output;
    uint32_t frames;
} session;

typedef struct {
    uint32_t cycles;
    uint16_t stack;
} cost;

static uint32_t data_address(const char *text)
{
    uint32_t address = number(text, "address");
    return address >= DATA_SPACE ? address - DATA_SPACE : address;
}

static span data_span(const avr_t *avr, char *text)
{
    char *colon = strchr(text, ':');
    if (colon == NULL)
        fail("\"%s\" is not ADDRESS:SIZE", text);
    *colon = '\0';
    span found = {data_address(text), number(colon + 1, "size")};
    if (found.size > LONGEST || found.address + found.size > (uint32_t)avr->ramend + 1)
        fail("there are no %u bytes at 0x%x: the RAM ends at 0x%x", found.size, found.address, avr->ramend);
    return found;
}

/* Run one instruction. */
static void step(avr_t *avr)
{
    int state = avr_run(avr);
    if (state != cpu_Running)
        fail("the program stopped at 0x%x", avr->pc);
}

static void run_to_function(const session *run)
{
    avr_cycle_count_t end = run->avr->cycle + MOST_START;
    while (run->avr->pc != run->function) {
        step(run->avr);
        if (run->avr->cycle > end)
            fail("the program does not call the function at 0x%x", run->function);
    }
}

/* Return where the function that was just entered returns to, in bytes: on top of the stack, high byte first. */
static uint32_t return_address(const avr_t *avr)
{
    const uint8_t *stacked = avr->data + stack_pointer(avr) + 1;
    uint32_t words = 0;
    for (uint8_t byte = 0; byte < avr->address_size; byte++)
        words = words << 8 | stacked[byte];
    return words * 2;
}

/* Different in every frame: a byte that happens to be left as it was is not left so again. */
static uint8_t pattern(uint32_t frame, uint16_t address)
{
    return (uint8_t)(address * 29u + frame * 101u + 7u);
}

static void paint(const session *run, uint16_t top)
{
    for (uint16_t address = run->free; address <= top; address++)
        run->avr->data[address] = pattern(run->frames, address);
}

static uint16_t stack_used(const session *run, uint16_t top)
{
    uint16_t address = run->free;
    while (address <= top && run->avr->data[address] == pattern(run->frames, address))
        address++;
    return (uint16_t)(top + 1 - address + run->avr->address_size);
}

/* Run the function that was just entered until it is back. */
static cost run_function(session *run)
{
    avr_t *avr = run->avr;
    uint16_t top = stack_pointer(avr);
    uint32_t back = return_address(avr);
    avr_cycle_count_t begun = avr->cycle;
    paint(run, top);
    while (avr->pc != back || stack_pointer(avr) != top + avr->address_size) {
        step(avr);
        if (avr->cycle - begun > MOST_CYCLES)
            fail("frame %u: the function does not return within %d cycles", run->frames, MOST_CYCLES);
    }
    cost taken = {(uint32_t)(avr->cycle - begun), stack_used(run, top)};
    run->frames++;
    return taken;
}

static bool next_frame(const session *run)
{
    uint8_t frame[LONGEST];
    if (fread(frame, 1, run->input.size, stdin) != run->input.size)
        return false;
    memcpy(run->avr->data + run->input.address, frame, run->input.size);
    return true;
}

static void put(uint32_t value, int bytes)
{
    for (int byte = 0; byte < bytes; byte++)
        putchar((int)(value >> 8 * byte & 0xFF));
}

static void answer(const session *run, cost taken)
{
    fwrite(run->avr->data + run->output.address, 1, run->output.size, stdout);
    fwrite(run->avr->data + RETURNED, 1, 2, stdout);
    put(taken.cycles, 4);
    put(taken.stack, 2);
}

int main(int count, char **arguments)
{
    if (count != 8)
        fail("usage: simavr_classify MCU HZ ELF FUNCTION FREE INPUT:SIZE OUTPUT:SIZE");
    avr_t *avr = load(arguments[1], number(arguments[2], "frequency"), arguments[3]);
    avr->run_cycle_limit = 1; /* else simavr runs many instructions at a time */
    session run = {
        .avr = avr,
        .function = number(arguments[4], "address"),
        .free = (uint16_t)data_address(arguments[5]),
        .input = data_span(avr, arguments[6]),
        .output = data_span(avr, arguments[7]),
    };
    run_to_function(&run);
    while (next_frame(&run)) {
        answer(&run, run_function(&run));
        run_to_function(&run);
    }
    if (fflush(stdout) != 0)
        fail("the answers cannot be written");
    return 0;
}

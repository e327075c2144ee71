/*
 * A whole board in real time: an AVR, switches on its pins or on port expanders, and its UARTs on ptys.
 *
 *     simavr_board WIRING ELF
 *
 * WIRING is a file of lines, in this order; keys are numbers of the caller's own:
 *
 *     part atmega328p 16000000            part, clock in Hz
 *     uart 0 1000000 /tmp/port            UART, baud rate of what comes to it, name of its port
 *     join 1 115200 /tmp/glove            the same on a port that is there: an emulated device's
 *     rise 5                              microseconds that a wire of a pin needs to rise through its pull-up
 *     pin KEY PD2 GND                     a switch between a pin and ground, or two pins
 *     diode KEY PD2 PB0                   a switch and a diode, by which current flows from PD2 to PB0 only
 *     mux 0 150 PB0 PB1 PB2 PB3           a CD74HC4067 at analog input 0, with these pins at S0 to S3; a channel that
 *                                         is selected takes so many microseconds to settle
 *     chip mcp23017 0x20
 *     key KEY 0x20 7 low                  a switch at pin 7 of this chip, which reads low when it is closed
 *
 * stdout: a line of JSON with the names of the ports, then one for every command of stdin, as soon as it is done:
 * time_us and board_us are when that was on the monotonic clock, and when it was for the program, which is behind as
 * long as this process waits for a processor. Commands are lines:
 *
 *     close KEY, open KEY                 a switch
 *     set KEYS                            all switches: bit k % 8 of byte k / 8 (hexadecimal) is key k
 *     volts CHANNEL MILLIVOLTS            what one of the analog inputs 0 to 7 has
 *     volts CHANNEL N MILLIVOLTS          what channel N of the multiplexer at that input has
 *     reset                               the RESET pin: a chip that was sending a byte then holds SDA low for nine clocks
 *     brownout MICROSECONDS               no power for so long: RAM is garbage then, and the chips' registers are gone
 *     unplug ADDRESS, replug ADDRESS      a chip off the bus, and back as after power-on
 *     hold, free                          SDA stuck low
 *     now                                 nothing: what counts is the answer
 *     uart 0 off, uart 0 on               the cable to the host
 *     inframe COMMAND                     any of these, once the third byte of the next frame on UART 0 has been sent
 *     inread COMMAND                      the same, once a chip is sending a byte
 *     quit
 *
 * Exit code 2: something is wrong, one line on stderr.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <simavr/avr_adc.h>

#include "board_chips.h"
#include "board_mux.h"
#include "board_pins.h"
#include "board_twi.h"
#include "board_uart.h"
#include "harness.h"

/* ANALOG_INPUTS: libsimavr keeps the voltages of so many, whatever the part has. */
enum { SLICE_US = 500, LONGEST = 1024, WORDS = 7, IN_FRAME = 3, SUPPLY_MV = 5000, ANALOG_INPUTS = 8 };

static avr_t *avr;
/* The program is where it should be in time when its cycles since `begun_cycle` took as long as it is since then. */
static uint64_t begun_us;
static avr_cycle_count_t begun_cycle;
static uint64_t powered_us;
static char pending[LONGEST];
static bool (*is_time)(void); /* for what is pending */
static volatile sig_atomic_t ended;

static uint64_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

static int split(char *text, char **words)
{
    int count = 0;
    for (char *word = strtok(text, " \n"); word != NULL && count < WORDS; word = strtok(NULL, " \n"))
        words[count++] = word;
    return count;
}

/* ---- wiring ---- */

static void part(const char *name, const char *clock, const char *elf)
{
    avr = load(name, number(clock, "clock"), elf);
    avr->vcc = avr->avcc = avr->aref = SUPPLY_MV;
    avr->run_cycle_limit = (avr_cycle_count_t)avr->frequency * SLICE_US / 1000000;
    twi_attach(avr);
}

static void wire(char *text, const char *elf)
{
    char *word[WORDS];
    int count = split(text, word);
    if (count == 0)
        return;
    if (avr == NULL && strcmp(word[0], "part") != 0)
        fail("the wiring must begin with the part");
    if (strcmp(word[0], "part") == 0 && count == 3)
        part(word[1], word[2], elf);
    else if ((strcmp(word[0], "uart") == 0 || strcmp(word[0], "join") == 0) && count == 4)
        uart_add(avr, (uint8_t)number(word[1], "UART"), number(word[2], "baud rate"), word[3], word[0][0] == 'j');
    else if (strcmp(word[0], "rise") == 0 && count == 2)
        pins_attach(avr, number(word[1], "time"));
    else if ((strcmp(word[0], "pin") == 0 || strcmp(word[0], "diode") == 0) && count == 4)
        pins_add((uint16_t)number(word[1], "key"), word[2], word[3], word[0][0] == 'd');
    else if (strcmp(word[0], "mux") == 0 && count == 7)
        mux_add(avr, number(word[1], "analog input"), number(word[2], "time"), word + 3);
    else if (strcmp(word[0], "chip") == 0 && count == 3)
        chips_add(word[1], (uint8_t)number(word[2], "address"));
    else if (strcmp(word[0], "key") == 0 && count == 5)
        chips_add_key((uint16_t)number(word[1], "key"), (uint8_t)number(word[2], "address"),
                      (uint8_t)number(word[3], "pin"), strcmp(word[4], "high") == 0);
    else
        fail("the wiring has a line \"%s\" with %d words", word[0], count);
}

static void wire_all(const char *wiring, const char *elf)
{
    char text[LONGEST];
    FILE *file = fopen(wiring, "r");
    if (file == NULL)
        fail("%s cannot be read", wiring);
    while (fgets(text, sizeof text, file) != NULL)
        wire(text, elf);
    fclose(file);
    if (avr == NULL)
        fail("%s is empty", wiring);
}

/* ---- commands ---- */

static void reset(const avr_regbit_t *cause)
{
    avr_reset(avr);
    if (cause->reg)
        avr_regbit_set(avr, *cause);
}

static void lose_power(uint32_t for_us)
{
    uart_glitch(0xFE); /* the line rises in the middle of a byte */
    uint32_t garbage = 1u + (uint32_t)avr->cycle;
    for (uint32_t address = 0; address <= avr->ramend; address++) {
        garbage = garbage * 1664525u + 1013904223u;
        if (address < 32 || address > avr->ioend)
            avr->data[address] = (uint8_t)(garbage >> 24);
    }
    chips_power();
    reset(&avr->reset_flags.borf);
    twi_power();
    powered_us = now_us() + for_us;
}

static bool close_key(uint16_t key, bool closed)
{
    bool at_pin = pins_close(key, closed);
    return chips_close(key, closed) || at_pin;
}

static bool set_keys(const char *bytes)
{
    size_t count = strlen(bytes) / 2;
    for (size_t byte = 0; byte < count; byte++) {
        const char digits[] = {bytes[2 * byte], bytes[2 * byte + 1], '\0'};
        unsigned long value = strtoul(digits, NULL, 16);
        for (size_t bit = 0; bit < 8; bit++)
            close_key((uint16_t)(8 * byte + bit), value >> bit & 1);
    }
    return count > 0;
}

static bool volts(uint32_t channel, uint32_t millivolts)
{
    if (channel >= ANALOG_INPUTS)
        return false;
    avr_irq_t *input = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, (int)(ADC_IRQ_ADC0 + channel));
    if (input != NULL)
        avr_raise_irq(input, millivolts);
    return input != NULL;
}

static bool obey_plain(const char *verb)
{
    if (strcmp(verb, "reset") == 0)
        reset(&avr->reset_flags.extrf);
    else if (strcmp(verb, "hold") == 0 || strcmp(verb, "free") == 0)
        twi_hold(verb[0] == 'h');
    else if (strcmp(verb, "now") == 0)
        return true;
    else if (strcmp(verb, "quit") == 0)
        ended = 1;
    else
        return false;
    return true;
}

static bool obey_with(const char *verb, char *const *word, int count)
{
    if (count == 2 && (strcmp(verb, "close") == 0 || strcmp(verb, "open") == 0))
        return close_key((uint16_t)number(word[0], "key"), verb[0] == 'c');
    if (count == 2 && (strcmp(verb, "unplug") == 0 || strcmp(verb, "replug") == 0))
        return chips_plug((uint8_t)number(word[0], "address"), verb[0] == 'r');
    return false;
}

static bool obey(char *text)
{
    char *word[WORDS];
    int count = split(text, word);
    if (count == 1)
        return obey_plain(word[0]);
    if (count == 2 && strcmp(word[0], "set") == 0)
        return set_keys(word[1]);
    if (count == 2 && strcmp(word[0], "brownout") == 0) {
        lose_power(number(word[1], "time"));
        return true;
    }
    if (count == 3 && strcmp(word[0], "volts") == 0)
        return volts(number(word[1], "channel"), number(word[2], "voltage"));
    if (count == 4 && strcmp(word[0], "volts") == 0)
        return mux_volts(number(word[1], "analog input"), number(word[2], "channel"), number(word[3], "voltage"));
    if (count == 3 && strcmp(word[0], "uart") == 0)
        return uart_plug((uint8_t)number(word[1], "UART"), strcmp(word[2], "on") == 0);
    return count == 2 && obey_with(word[0], word + 1, count);
}

static uint64_t board_us(void)
{
    return begun_us + (avr->cycle - begun_cycle) * 1000000u / avr->frequency;
}

static void answer(char *text)
{
    unsigned long long at_us = board_us();
    bool done = obey(text);
    printf("{\"done\": %s, \"time_us\": %llu, \"board_us\": %llu, \"cycle\": %llu, \"starts\": %u}\n",
           done ? "true" : "false", (unsigned long long)now_us(), at_us, (unsigned long long)avr->cycle, twi_starts());
    fflush(stdout);
}

static bool in_frame(void)
{
    return uart_in_frame() >= IN_FRAME;
}

static bool wait_for(bool (*when)(void), const char *word, const char *text)
{
    size_t length = strlen(word);
    if (strncmp(text, word, length) != 0)
        return false;
    snprintf(pending, sizeof pending, "%s", text + length);
    is_time = when;
    return true;
}

static void command(char *text)
{
    if (!wait_for(in_frame, "inframe ", text) && !wait_for(twi_reads, "inread ", text))
        answer(text);
}

static void take_commands(void)
{
    static char waiting[2 * LONGEST];
    static size_t filled;
    ssize_t count = read(STDIN_FILENO, waiting + filled, sizeof waiting - 1 - filled);
    if (count == 0)
        ended = 1; /* whoever started us is gone */
    if (count <= 0)
        return;
    filled += (size_t)count;
    waiting[filled] = '\0';
    char *from = waiting, *end;
    while ((end = strchr(from, '\n')) != NULL) {
        *end = '\0';
        command(from);
        from = end + 1;
    }
    filled = strlen(from);
    memmove(waiting, from, filled + 1);
}

/* ---- time ---- */

static void do_not_sleep(avr_t *sleeping, avr_cycle_count_t cycles)
{
    (void)sleeping, (void)cycles; /* the pace is kept by slices */
}

static void end(int signal)
{
    (void)signal;
    ended = 1;
}

static void anchor(void)
{
    begun_us = now_us();
    begun_cycle = avr->cycle;
}

static void run_until(avr_cycle_count_t cycle)
{
    while (avr->cycle < cycle && powered_us == 0) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            fail("the program stopped at 0x%x", avr->pc);
        if (pending[0] != '\0' && is_time()) {
            char text[LONGEST];
            memcpy(text, pending, sizeof text);
            pending[0] = '\0';
            answer(text);
        }
    }
}

static void sleep_until(uint64_t time_us)
{
    uint64_t now = now_us();
    if (now >= time_us)
        return;
    struct timespec left = {.tv_sec = 0, .tv_nsec = (long)(time_us - now) * 1000};
    if (left.tv_nsec > 999999999)
        left.tv_nsec = 999999999;
    nanosleep(&left, NULL);
}

static void slice(void)
{
    if (powered_us != 0) {
        sleep_until(powered_us < now_us() + SLICE_US ? powered_us : now_us() + SLICE_US);
        if (now_us() >= powered_us) {
            powered_us = 0;
            anchor();
        }
        return;
    }
    avr_cycle_count_t next = avr->cycle + (avr_cycle_count_t)avr->frequency * SLICE_US / 1000000;
    run_until(next);
    sleep_until(board_us());
}

int main(int count, char **arguments)
{
    if (count != 3)
        fail("usage: simavr_board WIRING ELF");
    wire_all(arguments[1], arguments[2]);
    avr->sleep = do_not_sleep;
    signal(SIGTERM, end);
    signal(SIGINT, end);
    signal(SIGPIPE, SIG_IGN);
    fcntl(STDIN_FILENO, F_SETFL, O_NONBLOCK);
    printf("{");
    uart_names(stdout);
    printf("}\n");
    fflush(stdout);
    anchor();
    while (!ended) {
        slice();
        uart_carry();
        take_commands();
    }
    uart_unlink();
    return 0;
}

#include "board_uart.h"

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include <simavr/avr_uart.h>

enum { MOST_UARTS = 4, MOST_WAITING = 4096, BITS_PER_BYTE = 10 };

typedef struct {
    avr_io_t module; /* first, so that its reset finds the line */
    avr_t *avr;
    uint8_t number;
    char link[256];
    bool joined; /* the port is another's */
    int master; /* -1: unplugged; of a port that was joined, the slave */
    avr_irq_t *input;
    avr_cycle_count_t byte_cycles, next_due;
    uint8_t sent[MOST_WAITING], heard[256];
    size_t n_sent, n_heard, at_heard;
    uint32_t in_frame;
} line;

static line lines[MOST_UARTS];
static int n_lines;

static void from_avr(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    line *one = param;
    one->in_frame = value == 0 ? 0 : one->in_frame + 1;
    if (one->n_sent < MOST_WAITING)
        one->sent[one->n_sent++] = (uint8_t)value;
}

static void make_port(line *one)
{
    int slave;
    struct termios raw;
    memset(&raw, 0, sizeof raw);
    cfmakeraw(&raw);
    if (openpty(&one->master, &slave, NULL, &raw, NULL) != 0)
        fail("there is no pty left");
    fcntl(one->master, F_SETFL, O_NONBLOCK);
    unlink(one->link);
    if (symlink(ttyname(slave), one->link) != 0)
        fail("%s cannot be made", one->link);
    close(slave); /* so that the master is told whether a client has the port open */
}

static void join_port(line *one)
{
    struct termios raw;
    one->master = open(one->link, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (one->master < 0 || tcgetattr(one->master, &raw) != 0)
        fail("%s is no port", one->link);
    cfmakeraw(&raw);
    tcsetattr(one->master, TCSANOW, &raw);
}

static void plug(line *one)
{
    if (one->joined)
        join_port(one);
    else
        make_port(one);
    one->n_sent = one->n_heard = one->at_heard = 0;
}

/* simavr forgets its timers at a reset, and a UART what was on its way to it. */
static void reset(avr_io_t *module)
{
    line *one = (line *)module;
    one->n_heard = one->at_heard = 0;
    one->next_due = 0;
}

void uart_add(avr_t *avr, uint8_t number, uint32_t baud, const char *link, bool joined)
{
    if (n_lines == MOST_UARTS)
        fail("more than %d UARTs", MOST_UARTS);
    line *one = &lines[n_lines++];
    uint32_t ioctl = AVR_IOCTL_UART_GETIRQ('0' + number), quiet = 0;
    avr_irq_t *output = avr_io_getirq(avr, ioctl, UART_IRQ_OUTPUT);
    if (output == NULL)
        fail("the part has no UART %u", number);
    *one = (line){.avr = avr, .number = number, .joined = joined, .input = avr_io_getirq(avr, ioctl, UART_IRQ_INPUT)};
    one->byte_cycles = (avr_cycle_count_t)avr->frequency * BITS_PER_BYTE / baud;
    snprintf(one->link, sizeof one->link, "%s", link);
    avr_irq_register_notify(output, from_avr, one);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0' + number), &quiet);
    one->module = (avr_io_t){.kind = "thenar uart", .reset = reset};
    avr_register_io(avr, &one->module);
    plug(one);
}

static bool has_client(const line *one)
{
    struct pollfd found = {.fd = one->master, .events = POLLOUT};
    return poll(&found, 1, 0) >= 0 && !(found.revents & POLLHUP);
}

static void send_on(line *one)
{
    if (one->n_sent == 0)
        return;
    ssize_t written = has_client(one) ? write(one->master, one->sent, one->n_sent) : (ssize_t)one->n_sent;
    if (written <= 0)
        return;
    memmove(one->sent, one->sent + written, one->n_sent - (size_t)written);
    one->n_sent -= (size_t)written;
}

/* One byte for the AVR, when the one before it is over. */
static avr_cycle_count_t to_avr(struct avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr;
    line *one = param;
    if (one->at_heard == one->n_heard)
        return 0;
    avr_raise_irq(one->input, one->heard[one->at_heard++]);
    one->next_due = when + one->byte_cycles;
    return one->at_heard < one->n_heard ? one->next_due : 0;
}

static void hear(line *one)
{
    bool quiet = one->at_heard == one->n_heard;
    one->n_heard -= one->at_heard;
    memmove(one->heard, one->heard + one->at_heard, one->n_heard);
    one->at_heard = 0;
    ssize_t count = read(one->master, one->heard + one->n_heard, sizeof one->heard - one->n_heard);
    one->n_heard += count > 0 ? (size_t)count : 0;
    if (!quiet || one->n_heard == 0)
        return;
    avr_cycle_count_t now = one->avr->cycle;
    avr_cycle_count_t wait = one->next_due > now ? one->next_due - now : 0;
    avr_cycle_timer_register(one->avr, wait + one->byte_cycles, to_avr, one);
}

void uart_carry(void)
{
    for (line *one = lines; one < lines + n_lines; one++) {
        if (one->master >= 0) {
            send_on(one);
            hear(one);
        } else {
            one->n_sent = 0;
        }
    }
}

static void unplug(line *one)
{
    avr_cycle_timer_cancel(one->avr, to_avr, one);
    if (!one->joined)
        unlink(one->link);
    close(one->master);
    one->master = -1;
}

bool uart_plug(uint8_t number, bool plugged)
{
    for (line *one = lines; one < lines + n_lines; one++)
        if (one->number == number) {
            if (plugged && one->master < 0)
                plug(one);
            if (!plugged && one->master >= 0)
                unplug(one);
            return true;
        }
    return false;
}

void uart_unlink(void)
{
    for (line *one = lines; one < lines + n_lines; one++)
        if (one->master >= 0 && !one->joined)
            unlink(one->link);
}

uint32_t uart_in_frame(void)
{
    return lines[0].in_frame;
}

void uart_glitch(uint8_t byte)
{
    from_avr(NULL, byte, &lines[0]);
}

void uart_names(FILE *to)
{
    for (const line *one = lines; one < lines + n_lines; one++)
        fprintf(to, "%s\"uart%u\": \"%s\"", one == lines ? "" : ", ", one->number, one->link);
}

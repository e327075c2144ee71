/*
 * A program on an AVR whose inputs have fixed levels: stdout is what it sends at UART 0.
 *
 *     simavr_rows PART HZ ELF MICROSECONDS [D2=0 ...] [ADC0=MILLIVOLTS ...]
 *
 * Exit code 2: something is wrong, one line on stderr.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>

#include "harness.h"

enum { SUPPLY_MV = 5000, PORTS = 26 };

static void sent(struct avr_irq_t *irq, uint32_t byte, void *param)
{
    (void)irq, (void)param;
    putchar((int)byte);
}

static void listen(avr_t *avr)
{
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)AVR_UART_FLAG_STDIO;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
}

static void set_pin(avr_t *avr, char port, uint32_t bit, uint32_t level)
{
    static avr_ioport_external_t pulled[PORTS];
    avr_ioport_external_t *one = &pulled[port - 'A'];
    one->name = (unsigned long)port;
    one->mask |= 1u << bit;
    one->value = (one->value & ~(1u << bit)) | level << bit;
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), one);
}

static void set_input(avr_t *avr, const char *text)
{
    unsigned place, value;
    char port;
    if (sscanf(text, "ADC%u=%u", &place, &value) == 2)
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, (int)(ADC_IRQ_ADC0 + place)), value);
    else if (sscanf(text, "%c%u=%u", &port, &place, &value) == 3 && port >= 'A' && port <= 'Z' && place < 8)
        set_pin(avr, port, place, value != 0);
    else
        fail("there is no input %s", text);
}

int main(int count, char **arguments)
{
    if (count < 5)
        fail("usage: simavr_rows PART HZ ELF MICROSECONDS [INPUT=LEVEL ...]");
    avr_t *avr = load(arguments[1], number(arguments[2], "clock"), arguments[3]);
    avr->vcc = avr->avcc = avr->aref = SUPPLY_MV;
    listen(avr);
    for (int input = 5; input < count; input++)
        set_input(avr, arguments[input]);
    avr_cycle_count_t end = (avr_cycle_count_t)number(arguments[4], "time") * avr->frequency / 1000000;
    while (avr->cycle < end) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            fail("the program stopped at 0x%x", avr->pc);
    }
    return 0;
}

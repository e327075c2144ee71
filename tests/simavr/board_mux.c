#include "board_mux.h"

#include <stdlib.h>
#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_ioport.h>
#include <simavr/sim_cycle_timers.h>

enum { MOST_MUXES = 8, SELECT = 4, CHANNELS = 1 << SELECT };

typedef struct {
    avr_t *avr;
    uint32_t input, settle_us, selected, millivolts[CHANNELS];
} mux;

static mux muxes[MOST_MUXES];
static int n_muxes;

/* One pin of a multiplexer's four. */
typedef struct {
    mux *of;
    uint32_t bit;
} line;

static line lines[MOST_MUXES * SELECT];

static avr_cycle_count_t settle(avr_t *avr, avr_cycle_count_t when, void *param)
{
    const mux *one = param;
    (void)when;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, (int)(ADC_IRQ_ADC0 + one->input)),
                  one->millivolts[one->selected]);
    return 0;
}

static void select_line(avr_irq_t *irq, uint32_t value, void *param)
{
    const line *on = param;
    (void)irq;
    on->of->selected = (on->of->selected & ~(1u << on->bit)) | (value ? 1u << on->bit : 0u);
    avr_cycle_timer_cancel(on->of->avr, settle, on->of);
    avr_cycle_timer_register_usec(on->of->avr, on->of->settle_us, settle, on->of);
}

void mux_add(avr_t *avr, uint32_t input, uint32_t settle_us, char *const *pins)
{
    if (n_muxes == MOST_MUXES || input >= 8)
        fail("no room for a multiplexer at analog input %u", input);
    mux *one = &muxes[n_muxes];
    *one = (mux){.avr = avr, .input = input, .settle_us = settle_us};
    for (uint32_t bit = 0; bit < SELECT; bit++) {
        line *on = &lines[n_muxes * SELECT + (int)bit];
        *on = (line){.of = one, .bit = bit};
        if (strlen(pins[bit]) != 3)
            fail("there is no pin %s", pins[bit]);
        avr_irq_t *irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(pins[bit][1]), pins[bit][2] - '0');
        if (irq == NULL)
            fail("there is no pin %s", pins[bit]);
        avr_irq_register_notify(irq, select_line, on);
    }
    n_muxes++;
}

bool mux_volts(uint32_t input, uint32_t channel, uint32_t millivolts)
{
    for (mux *one = muxes; one < muxes + n_muxes; one++)
        if (one->input == input && channel < CHANNELS) {
            one->millivolts[channel] = millivolts;
            if (one->selected == channel)
                settle(one->avr, 0, one);
            return true;
        }
    return false;
}

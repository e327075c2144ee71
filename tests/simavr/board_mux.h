/* CD74HC4067 multiplexers between sixteen voltages and an analog input of the AVR, selected by four of its pins. */
#ifndef THENAR_BOARD_MUX_H
#define THENAR_BOARD_MUX_H

#include <stdbool.h>

#include "harness.h"

/* Put one at this analog input; `pins` ("PB0") drive S0 to S3. What is selected takes `settle_us` to get through: until
 * then the input has what it had. */
void mux_add(avr_t *avr, uint32_t input, uint32_t settle_us, char *const *pins);

/* Let a channel have a voltage. Return false where there is no such multiplexer or channel. */
bool mux_volts(uint32_t input, uint32_t channel, uint32_t millivolts);

#endif

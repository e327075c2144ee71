/* Tables in flash: an AVR needs special instructions to read them, other parts do not.

   thenar 0.1.0, template board/thenar_flash.h.j2. */
#ifndef THENAR_FLASH_H
#define THENAR_FLASH_H

#ifdef __AVR__
#include <avr/pgmspace.h>
#else
#include <string.h>

#define PROGMEM
#define memcpy_P memcpy
#define pgm_read_byte(place) (*(place))
#define pgm_read_word(place) (*(place))
#endif

#endif

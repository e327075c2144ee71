/* thenar_glove_tables.h: definitions of the tables for the library's own files; programs do not need it.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME_tables.h.j2. */
#ifndef THENAR_GLOVE_TABLES_H
#define THENAR_GLOVE_TABLES_H

#include "thenar_glove.h"

#define CLASSES THENAR_GLOVE_CLASSES
#define INPUTS 8u
#define PARTS 1u
#define ROWS 23u
#define LOOKUPS 4u
#define LANES 2u /* words of two sums */

#ifdef __AVR__
#include <avr/pgmspace.h>

#define IN_FLASH PROGMEM
#define READ_BYTE(place) pgm_read_byte(&(place))
#define READ_WORD(place) pgm_read_word(&(place))

/* A row is an entry for every class; thenar_glove_avr.S adds them up. */
typedef int16_t thenar_glove_row[3];
#else
#define IN_FLASH
#define READ_BYTE(place) (place)
#define READ_WORD(place) (place)

/* Elsewhere than on an AVR a word holds the entries of two classes, as one sum: they are added up at once. */
#define WORDS 2u
typedef uint32_t thenar_glove_row[WORDS];
#endif

extern const thenar_glove_row thenar_glove_rows[PARTS * ROWS];
extern const char thenar_glove_names[4][14];

/* The place of a switch in the input: byte and bit. */
typedef struct {
    uint8_t port;
    uint8_t bit;
} thenar_glove_place;
extern const thenar_glove_place thenar_glove_places[THENAR_GLOVE_SWITCHES];

/* The contribution of a missing input, relative to open or code 0: switches, then joints. */
typedef int16_t thenar_glove_mean;
extern const thenar_glove_mean thenar_glove_means[INPUTS][CLASSES];

/* 2 to the power of 15 - i / 64. */
extern const uint16_t thenar_glove_powers[65];

/* The initial scores, before any row is added. */
#ifdef __AVR__
extern const int16_t thenar_glove_start[CLASSES];
#else
extern const uint32_t thenar_glove_start[PARTS][LANES];
#endif

#endif

/* SPDX-License-Identifier: MIT */
/**
 * @file thenar.h
 * @brief Recognises grasps from the switches and joints of a glove, by integer tables.
 *
 * The score of a grasp type is the sum of what every input adds to it; the type with the largest score is recognised.
 * Scores are the same as those that thenar computes in Python, bit for bit. There is no heap, no floating point and no
 * state outside of the caller's struct.
 *
 *     #include "thenar_glove.h"
 *
 *     static uint16_t memory[THENAR_GLOVE_MEMORY];
 *     static thenar hand;
 *
 *     thenar_init(&hand, &thenar_glove_model, memory);
 *     thenar_set_switch(&hand, THENAR_GLOVE_SWITCH_..., closed);
 *     thenar_set_code(&hand, THENAR_GLOVE_JOINT_..., code);
 *     uint16_t grasp = thenar_decide(&hand, thenar_classify(&hand));
 *
 * The tables of a build are in its thenar_NAME.h and thenar_NAME.c.
 */
#ifndef THENAR_H
#define THENAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Tables stay in flash, which an AVR reads by special instructions. Entries of a row are given in pairs, of two grasp
   types: as one word, or one after the other on an AVR (see thenar_block.h). */
#ifdef __AVR__
#include <avr/pgmspace.h>
#define THENAR_FLASH PROGMEM
#define THENAR_READ_8(place) pgm_read_byte(place)
#define THENAR_READ_16(place) pgm_read_word(place)
#define THENAR_START(low, high) (int16_t)(uint16_t)(low), (int16_t)(uint16_t)(high)
#define THENAR_PAIR(low, high) (low), (high)
#define THENAR_SLOPES(low, high) (low), (high)
#define THENAR_ENTRIES 2u /* elements of a pair */
typedef int16_t thenar_pair;
typedef int8_t thenar_slopes;
#else
#define THENAR_FLASH
#define THENAR_READ_8(place) (*(place))
#define THENAR_READ_16(place) (*(place))
#define THENAR_START(low, high) (THENAR_PAIR(low, high) + 0x80008000u)
#define THENAR_PAIR(low, high) ((uint32_t)(int32_t)(low) + ((uint32_t)(int32_t)(high) << 16))
#define THENAR_SLOPES(low, high) THENAR_PAIR(low, high)
#define THENAR_ENTRIES 1u
typedef uint32_t thenar_pair;
typedef uint32_t thenar_slopes;
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** A joint that adds the row of the bin of its code: the bin is how many of its 2 `half` - 1 thresholds are below. */
typedef struct {
    uint16_t joint;
    uint16_t first_threshold;
    uint16_t half;
    uint16_t first_row; /* in pairs of entries, as all places of rows */
} thenar_bins;

/** A joint that adds a row times the distance of its code from `low`, at most `span`, shifted to fit in a byte. */
typedef struct {
    uint16_t joint;
    uint16_t low;
    uint16_t span;
    uint8_t left;
    uint8_t right;
} thenar_line;

/** Two joints that add the row of their cell: the `width` bins of `across` for each bin of `down`. */
typedef struct {
    uint16_t width;
    thenar_bins down;
    thenar_bins across;
} thenar_grid;

/** The limits of the training recordings of each grasp type: a frame beyond them is rejected. */
typedef struct {
    const int16_t *least_scores; /* [classes] */
    const uint16_t *closed;      /* [classes][2]: fewest and most closed switches */
    const uint16_t *ranges;      /* [classes][joints][2]: lowest and highest code */
    uint16_t outside;            /* the most joints that may be outside of their range */
} thenar_rejection;

typedef struct thenar thenar;

/** A classifier: tables, and their sizes. Pointers are to tables in flash, except `rejection`, which may be NULL. */
typedef struct {
    uint16_t classes;
    uint16_t switches;
    uint16_t joints;
    uint16_t none;       /* the number of "nothing is held" */
    uint16_t n_names;    /* the classes, and "none" where it is not one of them */
    uint16_t row_pairs;  /* at least 4 */
    uint16_t n_bins;
    uint16_t n_lines;
    uint16_t n_grids;
    uint16_t found;      /* the most rows that a frame adds, the start included */
    uint16_t step;       /* of the softmax, with `shift` */
    uint8_t shift;
    uint8_t group;       /* switches that share a lookup: 1 or 4 */
    uint8_t groups_of_byte;
    void (*sum)(thenar *hand);      /* thenar_sum, or straight-line code with the tables of switches and lines in it */
    const thenar_pair *rows;        /* the start; each group's sums but that of none; rows of bins; rows of grids */
    const thenar_slopes *slopes;    /* a row for each line */
    const thenar_bins *bins;
    const thenar_line *lines;
    const thenar_grid *grids;
    const uint16_t *thresholds;
    const int8_t *means;            /* [switches + joints][1 + classes]: a shift, then what a missing input adds to open
                                       or to code 0, shifted right by it */
    const char *names;              /* each with its end */
    const thenar_rejection *rejection;
} thenar_model;

/** A hand in a glove; the program reads `scores`, all other members are private. */
struct thenar {
    const thenar_model *model;
    int16_t *scores;   /**< [classes] of the last classify(). */
    uint8_t *switches; /* a bit for each: closed */
    uint16_t *codes;
    uint16_t *found;   /* the rows of the frame */
    uint8_t *distances;
    uint8_t *lost;     /* a bit for each: missing */
    uint16_t n_lost;
};

/** Initialise: all switches open, all codes 0, nothing missing. The tables' header has the words of `memory`. */
void thenar_init(thenar *hand, const thenar_model *model, uint16_t *memory);

/** Set whether a switch is closed. Ignored while it is missing, and for unknown numbers. */
void thenar_set_switch(thenar *hand, uint16_t number, bool closed);

/** Set a joint's code, in the units of the recordings. Ignored while it is missing, and for unknown numbers. */
void thenar_set_code(thenar *hand, uint16_t joint, uint16_t code);

/** Set whether a switch is missing: the mean of its rows replaces it, as in Python. Then it starts open. */
void thenar_lose_switch(thenar *hand, uint16_t number, bool lost);

/** Set whether a joint is missing: the mean of its rows replaces it, as in Python. Then its code starts at 0. */
void thenar_lose_joint(thenar *hand, uint16_t joint, bool lost);

/** Recognise the grasp type from the inputs: the one with the largest score, the first of equal ones. */
uint16_t thenar_classify(thenar *hand);

/** The first step of classify(), by the model's tables: the scores without the means of missing inputs; private. */
void thenar_sum(thenar *hand);

/** Reject a grasp type that classify() returned if the frame is unlike all training data: return the model's `none`. */
uint16_t thenar_decide(const thenar *hand, uint16_t grasp);

/** The lead of the best score over the second best, in steps. */
uint16_t thenar_margin(const thenar *hand);

/** The probability of a grasp type, 0 to 65535 (certain): the softmax of the scores. 0 for an unknown number. */
uint16_t thenar_probability(const thenar *hand, uint16_t grasp);

/**
 * Copy the name of a grasp type into `text`, in UTF-8, cut to `size` bytes with its end.
 *
 * @return the bytes of the whole name without its end; 0, and an empty text, for a number that has no name
 */
uint16_t thenar_name(const thenar_model *model, uint16_t grasp, char *text, uint16_t size);

#ifdef __cplusplus
}
#endif

#endif

/**
 * @file thenar_glove.h
 * @brief Recognises 3 grasp types from 6 switches and 2 joints of a glove.
 *
 * Layout for atmega328p: 16-bit entries, about 237 cycles a frame, 1293 bytes of flash, 30 of RAM.
 *
 * From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME.h.j2.
 */
#ifndef THENAR_GLOVE_H
#define THENAR_GLOVE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define THENAR_GLOVE_CLASSES 3u /**< Grasp types. */
#define THENAR_GLOVE_SWITCHES 6u /**< Kept switches. */
#define THENAR_GLOVE_PORTS 1u /**< Bytes for the switches. */
#define THENAR_GLOVE_JOINTS 2u /**< Joints. */

/** The number of a grasp type. */
typedef uint8_t thenar_glove_class;

/** The grasp types. */
enum {
    THENAR_GLOVE_GRASP_POWER_GRIP = 0, /**< power grip */
    THENAR_GLOVE_GRASP_TIP_PINCH = 1, /**< tip pinch */
    THENAR_GLOVE_GRASP_LATERAL_PINCH = 2, /**< lateral pinch */
};

/** The number of a switch. */
typedef uint8_t thenar_glove_switch;

/** The switches, and their places in the input. */
enum {
    THENAR_GLOVE_SWITCH_THUMB_TIP = 0, /**< thumb tip: switches[0], 0x01 */
    THENAR_GLOVE_SWITCH_INDEX_TIP = 1, /**< index tip: switches[0], 0x02 */
    THENAR_GLOVE_SWITCH_INDEX_MIDDLE = 2, /**< index middle: switches[0], 0x04 */
    THENAR_GLOVE_SWITCH_MIDDLE_TIP = 3, /**< middle tip: switches[0], 0x08 */
    THENAR_GLOVE_SWITCH_PALM_RADIAL = 4, /**< palm radial: switches[0], 0x10 */
    THENAR_GLOVE_SWITCH_PALM_ULNAR = 5, /**< palm ulnar: switches[0], 0x20 */
};

/** A joint's code, in the units of the recordings. For codes above 255 use 255. */
typedef uint8_t thenar_glove_code;

/** The joints, and the meaning of their codes. */
enum {
    THENAR_GLOVE_JOINT_THUMB_ROTATION = 0, /**< thumb_rotation: the glove's own codes */
    THENAR_GLOVE_JOINT_INDEX_PIJ = 1, /**< index_pij: the glove's own codes */
};

/** The readings of a glove. */
typedef struct {
    /** The bytes of the ports. A bit is 1 while its switch is closed; a bit without a switch is ignored. */
    uint8_t switches[THENAR_GLOVE_PORTS];
    /** The joints' codes, by their numbers. */
    thenar_glove_code codes[THENAR_GLOVE_JOINTS];
} thenar_glove_frame;

/** The inputs included in the sums; private. */
typedef struct {
#ifdef __AVR__
    uint8_t found[6];
#else
    const uint32_t *rows[4];
#endif
} thenar_glove_seen;

/** One glove. A program may have any number; a copy is another glove. */
typedef struct {
    int16_t scores[THENAR_GLOVE_CLASSES]; /**< Of the last prediction, equal to Python's. */
#ifdef __AVR__
    int16_t start[THENAR_GLOVE_CLASSES];
#else
    uint32_t sums[1][2]; /* private, as are all members without a description */
    uint32_t start[1][2];
#endif
    bool missing;
    bool begun;
    thenar_glove_frame input; /**< Written by the caller, read by classify() and update(). */
    thenar_glove_seen seen;
    uint8_t lost_switches[THENAR_GLOVE_PORTS];
    uint8_t lost_joints[(THENAR_GLOVE_JOINTS + 7u) / 8u];
    uint16_t n_lost;
} thenar_glove;

/** Initialise: all switches open, all codes 0, nothing missing. */
void thenar_glove_init(thenar_glove *glove);

/** Set in the input whether a switch is closed. Numbers from THENAR_GLOVE_SWITCHES on are ignored. */
void thenar_glove_set_switch(thenar_glove *glove, thenar_glove_switch number, bool closed);

/**
 * Set whether a switch is missing: it cannot be read. While it is missing, classify() and update() open it, and use the
 * mean of its rows instead, as in Python. Numbers from THENAR_GLOVE_SWITCHES on are ignored.
 */
void thenar_glove_lose_switch(thenar_glove *glove, thenar_glove_switch number, bool lost);

/**
 * Set whether a joint is missing: it cannot be read. While it is missing, classify() and update() set its code to 0,
 * and use the mean of its rows instead, as in Python. Numbers from THENAR_GLOVE_JOINTS on are ignored.
 */
void thenar_glove_lose_joint(thenar_glove *glove, uint16_t number, bool lost);

/**
 * Predict the grasp type from the input.
 *
 * @return the grasp type with the largest score, the first of equal ones
 */
thenar_glove_class thenar_glove_classify(thenar_glove *glove);

/** The same prediction, from the changes since the last update(); after init(), classify() or a loss from scratch. */
thenar_glove_class thenar_glove_update(thenar_glove *glove);

/** The lead of the best score over the second best, in steps. */
uint16_t thenar_glove_margin(const thenar_glove *glove);

/**
 * The probability of a grasp type: the softmax of the scores in integers, the same as Python's.
 *
 * @return 0 to 65535 (certain); 0 for a number that is not a grasp type
 */
uint16_t thenar_glove_probability(const thenar_glove *glove, thenar_glove_class grasp);

/** The name of a grasp type in UTF-8, "" for a number that is not one. On an AVR it is in flash: use strcpy_P(). */
const char *thenar_glove_grasp(thenar_glove_class grasp);

#ifdef __cplusplus
}
#endif

#endif

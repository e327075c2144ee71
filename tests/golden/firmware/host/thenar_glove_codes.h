/**
 * @file thenar_glove_codes.h
 * @brief Conversion of sensor readings to the codes of the tables: the same as Python's, for every reading.
 *
 * A sensor is calibrated by its readings at two points, which are named below, and converted by the straight line
 * through their codes.
 * The readings at these points are not known: `thenar firmware --glove glove.toml` takes them from a glove, or the
 * program calls calibrate().
 *
 * thenar 0.1.0, template codes/thenar_NAME_codes.h.j2.
 */
#ifndef THENAR_GLOVE_CODES_H
#define THENAR_GLOVE_CODES_H

#include "thenar_glove.h"

#ifdef __cplusplus
extern "C" {
#endif

#define THENAR_GLOVE_SENSORS 2u /**< Joints. */
#define THENAR_GLOVE_CALIBRATED 0 /**< Whether codes_init() knows all readings. */

/** The sensors, and the two points at which each is calibrated. */
enum {
    /** thumb_rotation: code 1 and code 255 */
    THENAR_GLOVE_SENSOR_THUMB_ROTATION = 0,
    /** index_pij: code 1 and code 255 */
    THENAR_GLOVE_SENSOR_INDEX_PIJ = 1,
};

/** The line of a sensor; private. */
typedef struct {
    uint16_t beyond[2]; /* the codes of readings before the first and after the last one */
    int32_t first;      /* the readings that the line converts */
    int32_t last;
    uint32_t gain;      /* what a reading adds, in 2^-16 of a code */
    uint16_t fine;      /* the rest of it, in 2^-32 */
    uint16_t span;      /* the readings from one point to the other */
    uint32_t offset;    /* the code of reading 0, and a half, in 2^-16, and 3 more for what is rounded */
    uint32_t step;      /* what a reading adds, in 2^-24 of a code by the span, modulo 2^32 */
    uint32_t sum;       /* the code of reading 0, and a half, likewise */
    bool calibrated;
} thenar_glove_line;

/** The calibration of each sensor. A copy is another one. */
typedef struct {
    thenar_glove_line lines[THENAR_GLOVE_SENSORS];
} thenar_glove_codes;

/** Initialise with the known readings. */
void thenar_glove_codes_init(thenar_glove_codes *codes);

/**
 * Set the readings of a sensor at its two points.
 *
 * @return false, without a change, if they give no line: equal readings, readings further apart than 65535, or no such
 *         sensor
 */
bool thenar_glove_calibrate(thenar_glove_codes *codes, uint16_t sensor, int32_t at_first, int32_t at_second);

/** Whether a sensor is calibrated. */
bool thenar_glove_calibrated(const thenar_glove_codes *codes, uint16_t sensor);

/** The code of a reading, -65535 to 65535; 0 for a sensor that is not calibrated. */
uint16_t thenar_glove_code_of(const thenar_glove_codes *codes, uint16_t sensor, int32_t reading);

/** Put a reading into the input: the code of a joint. */
void thenar_glove_set_reading(thenar *hand, const thenar_glove_codes *codes, uint16_t sensor, int32_t reading);

#ifdef __cplusplus
}
#endif

#endif

/**
 * @file thenar_glove_codes.h
 * @brief From what sensors read to what the tables expect: the same as Python's, for every reading.
 *
 * A sensor is calibrated by what it reads at two points, which are named below. A straight line runs through their
 * codes.
 * What it reads there is not known: `thenar firmware --glove glove.toml` takes it from a glove, calibrate() from the
 * program.
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

/** The sensors, and the two points at which each is read to calibrate it. */
enum {
    /** thumb_rotation: code 1 and code 255 */
    THENAR_GLOVE_SENSOR_THUMB_ROTATION = 0,
    /** index_pij: code 1 and code 255 */
    THENAR_GLOVE_SENSOR_INDEX_PIJ = 1,
};

/** What each sensor reads at its two points. A copy is another calibration. */
typedef struct {
    int32_t readings[THENAR_GLOVE_SENSORS][2]; /* equal: not known */
} thenar_glove_codes;

/** Begin with the readings that are known. */
void thenar_glove_codes_init(thenar_glove_codes *codes);

/**
 * Say what a sensor reads at its two points.
 *
 * @return false, and nothing has changed, where that makes no line: one reading at both, further apart than 65535, or
 *         no such sensor
 */
bool thenar_glove_calibrate(thenar_glove_codes *codes, uint16_t sensor, int32_t at_first, int32_t at_second);

/** Whether it is known what a sensor reads. */
bool thenar_glove_calibrated(const thenar_glove_codes *codes, uint16_t sensor);

/** The code of a reading, -65535 to 65535; 0 of a sensor that is not calibrated. */
uint16_t thenar_glove_code_of(const thenar_glove_codes *codes, uint16_t sensor, int32_t reading);

/** Put a reading into the input: the code of a joint. */
void thenar_glove_set_reading(
    thenar_glove *glove, const thenar_glove_codes *codes, uint16_t sensor, int32_t reading);

#ifdef __cplusplus
}
#endif

#endif

/**
 * @file thenar_glove.h
 * @brief The numbers and tables of 3 grasp types from 6 switches and 2 joints of a glove.
 *
 * From the tables 0123456789abcdef; thenar 0.1.0, template tables/thenar_NAME.h.j2.
 */
#ifndef THENAR_GLOVE_H
#define THENAR_GLOVE_H

#include "thenar.h"

#ifdef __cplusplus
extern "C" {
#endif

#define THENAR_GLOVE_CLASSES 3u
#define THENAR_GLOVE_SWITCHES 6u
#define THENAR_GLOVE_JOINTS 2u
#define THENAR_GLOVE_MEMORY 17u /**< Words of memory for thenar_init(). */
#define THENAR_GLOVE_NAME_BYTES 14u /**< Of the longest name, its end included. */

/** The grasp types. */
enum {
    THENAR_GLOVE_GRASP_POWER_GRIP = 0, /**< power grip */
    THENAR_GLOVE_GRASP_TIP_PINCH = 1, /**< tip pinch */
    THENAR_GLOVE_GRASP_LATERAL_PINCH = 2, /**< lateral pinch */
};

/** The switches. */
enum {
    THENAR_GLOVE_SWITCH_THUMB_TIP = 0, /**< thumb tip */
    THENAR_GLOVE_SWITCH_INDEX_TIP = 1, /**< index tip */
    THENAR_GLOVE_SWITCH_INDEX_MIDDLE = 2, /**< index middle */
    THENAR_GLOVE_SWITCH_MIDDLE_TIP = 3, /**< middle tip */
    THENAR_GLOVE_SWITCH_PALM_RADIAL = 4, /**< palm radial */
    THENAR_GLOVE_SWITCH_PALM_ULNAR = 5, /**< palm ulnar */
};

/** The joints, and the meaning of their codes. */
enum {
    THENAR_GLOVE_JOINT_THUMB_ROTATION = 0, /**< thumb_rotation: the glove's own codes */
    THENAR_GLOVE_JOINT_INDEX_PIJ = 1, /**< index_pij: the glove's own codes */
};

extern const thenar_model thenar_glove_model;

#ifdef __cplusplus
}
#endif

#endif

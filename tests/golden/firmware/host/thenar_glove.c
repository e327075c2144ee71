/* thenar_glove.c: the tables of 3 grasp types; thenar.h says how they are read.

   From the tables 0123456789abcdef; thenar 0.1.0, template tables/thenar_NAME.c.j2. */
#include "thenar_glove.h"

#define START THENAR_START
#define PAIR THENAR_PAIR
#define SLOPES THENAR_SLOPES

static const thenar_pair rows[] THENAR_FLASH = {
    /* The entries of a row: power grip, tip pinch, lateral pinch. */
    START(120, -40), START(7, 0), START(0, 0), START(0, 0),

    /* switches: thumb tip, index tip, index middle, middle tip */
    PAIR(310, 205), PAIR(-80, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(-45, 260), PAIR(33, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(265, 465), PAIR(-47, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(90, -12), PAIR(-7, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(400, 193), PAIR(-87, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(45, 248), PAIR(26, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(355, 453), PAIR(-54, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(150, -300), PAIR(41, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(460, -95), PAIR(-39, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(105, -40), PAIR(74, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(415, 165), PAIR(-6, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(240, -312), PAIR(34, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(550, -107), PAIR(-46, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(195, -52), PAIR(67, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(505, 153), PAIR(-13, 0), PAIR(0, 0), PAIR(0, 0),

    /* switches: palm radial, palm ulnar */
    PAIR(400, -390), PAIR(-120, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(77, -8), PAIR(260, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(477, -398), PAIR(140, 0), PAIR(0, 0), PAIR(0, 0),

    /* joints: thumb_rotation */
    PAIR(-200, 180), PAIR(90, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(-90, 100), PAIR(80, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(10, 20), PAIR(30, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(250, -170), PAIR(-60, 0), PAIR(0, 0), PAIR(0, 0),

    /* joints: index_pij */
    PAIR(-310, 40), PAIR(220, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(15, 130), PAIR(-25, 0), PAIR(0, 0), PAIR(0, 0),
    PAIR(330, -90), PAIR(-240, 0), PAIR(0, 0), PAIR(0, 0),
};

static const thenar_bins bins[] THENAR_FLASH = {
    {0u, 0u, 2u, 76u},
    {1u, 3u, 2u, 92u},
};

static const uint16_t thresholds[] THENAR_FLASH = {
    60u, 61u, 140u, 90u, 200u, 65535u,
};

static const int8_t means[] THENAR_FLASH = {
    1, 78, 51, -20,
    0, 0, 102, 0,
    0, 90, 0, -6,
    1, 75, 0, 0,
    1, 78, 0, -20,
    0, 76, 0, 0,
    1, 100, -89, -44,
    2, 78, -9, -54,
};

static const char names[] THENAR_FLASH =
    "power grip\000"
    "tip pinch\000"
    "lateral pinch";

const thenar_model thenar_glove_model = {
    .classes = 3u,
    .switches = 6u,
    .joints = 2u,
    .none = 3u,
    .n_names = 3u,
    .row_pairs = 4u,
    .n_bins = 2u,
    .n_lines = 0u,
    .n_grids = 0u,
    .found = 5u,
    .step = 60511u,
    .shift = 16u,
    .group = 4u,
    .groups_of_byte = 2u,
    .sum = thenar_sum,
    .rows = rows,
    .bins = bins,
    .thresholds = thresholds,
    .means = means,
    .names = names,
};

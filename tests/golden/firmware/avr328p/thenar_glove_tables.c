/* thenar_glove_tables.c: the tables.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME_tables.c.j2. */
#include "thenar_glove_tables.h"

#ifdef __AVR__
#define PAIR(a, b) (a), (b)
#define REST(a) (a)
#else
#define PAIR(a, b) ((uint32_t)(int32_t)(a) + ((uint32_t)(int32_t)(b) << 16))
#define REST(a) PAIR(a, 0)
#endif

const thenar_glove_row thenar_glove_rows[PARTS * ROWS] IN_FLASH = {
    /* columns: power grip, tip pinch, lateral pinch */

    /* switches 0 to 2: thumb tip, index tip, index middle */
    {PAIR(     0,      0), REST(     0)}, /* all open */
    {PAIR(   310,    205), REST(   -80)}, /* thumb tip */
    {PAIR(   -45,    260), REST(    33)}, /* index tip */
    {PAIR(   265,    465), REST(   -47)}, /* thumb tip + index tip */
    {PAIR(    90,    -12), REST(    -7)}, /* index middle */
    {PAIR(   400,    193), REST(   -87)}, /* thumb tip + index middle */
    {PAIR(    45,    248), REST(    26)}, /* index tip + index middle */
    {PAIR(   355,    453), REST(   -54)}, /* thumb tip + index tip + index middle */

    /* switches 3 to 5: middle tip, palm radial, palm ulnar */
    {PAIR(     0,      0), REST(     0)}, /* all open */
    {PAIR(   150,   -300), REST(    41)}, /* middle tip */
    {PAIR(   400,   -390), REST(  -120)}, /* palm radial */
    {PAIR(   550,   -690), REST(   -79)}, /* middle tip + palm radial */
    {PAIR(    77,     -8), REST(   260)}, /* palm ulnar */
    {PAIR(   227,   -308), REST(   301)}, /* middle tip + palm ulnar */
    {PAIR(   477,   -398), REST(   140)}, /* palm radial + palm ulnar */
    {PAIR(   627,   -698), REST(   181)}, /* middle tip + palm radial + palm ulnar */

    /* joint 0: thumb_rotation */
    {PAIR(   250,   -170), REST(   -60)}, /* thumb_rotation above 140 */
    {PAIR(    10,     20), REST(    30)}, /* thumb_rotation to 140 */
    {PAIR(   -90,    100), REST(    80)}, /* thumb_rotation to 61 */
    {PAIR(  -200,    180), REST(    90)}, /* thumb_rotation to 60 */

    /* joint 1: index_pij */
    {PAIR(   330,    -90), REST(  -240)}, /* index_pij above 200 */
    {PAIR(    15,    130), REST(   -25)}, /* index_pij to 200 */
    {PAIR(  -310,     40), REST(   220)}, /* index_pij to 90 */
};

const char thenar_glove_names[4][14] IN_FLASH = {
    "power grip",
    "tip pinch",
    "lateral pinch",
    "",
};

const thenar_glove_place thenar_glove_places[THENAR_GLOVE_SWITCHES] IN_FLASH = {
    {0, 1}, {0, 2}, {0, 4}, {0, 8}, {0, 16}, {0, 32},
};

const thenar_glove_mean thenar_glove_means[INPUTS][CLASSES] IN_FLASH = {
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {201, -178, -87},
    {314, -35, -214},
};

const uint16_t thenar_glove_powers[65] IN_FLASH = {
    32768, 32415, 32066, 31720, 31379, 31041, 30706, 30376, 30048, 29725, 29405, 29088, 28774, 28464, 28158, 27855,
    27554, 27258, 26964, 26674, 26386, 26102, 25821, 25543, 25268, 24995, 24726, 24460, 24196, 23936, 23678, 23423,
    23170, 22921, 22674, 22430, 22188, 21949, 21713, 21479, 21247, 21019, 20792, 20568, 20347, 20127, 19911, 19696,
    19484, 19274, 19066, 18861, 18658, 18457, 18258, 18061, 17867, 17674, 17484, 17296, 17109, 16925, 16743, 16562,
    16384,
};

#ifdef __AVR__
const int16_t thenar_glove_start[CLASSES] IN_FLASH = {
    120, -40, 7,
};
#else
/* Sums start 2^15 too high, so that no lane is negative at the end, after all borrows. */
#define LANE(start, shift) (((uint32_t)(int32_t)(start) + 32768u) << (shift))
#define START(a, b) (LANE(a, 0) + LANE(b, 16))

const uint32_t thenar_glove_start[PARTS][LANES] = {
    {
        START(120, -40), START(7, 0),
    },
};
#endif

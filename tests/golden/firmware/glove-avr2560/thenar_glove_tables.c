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

    /* switches 0 to 5: thumb tip, index tip, index middle, middle tip, palm radial, palm ulnar */
    {PAIR(     0,      0), REST(     0)}, /* all open */
    {PAIR(   310,    205), REST(   -80)}, /* thumb tip */
    {PAIR(   -45,    260), REST(    33)}, /* index tip */
    {PAIR(   265,    465), REST(   -47)}, /* thumb tip + index tip */
    {PAIR(    90,    -12), REST(    -7)}, /* index middle */
    {PAIR(   400,    193), REST(   -87)}, /* thumb tip + index middle */
    {PAIR(    45,    248), REST(    26)}, /* index tip + index middle */
    {PAIR(   355,    453), REST(   -54)}, /* thumb tip + index tip + index middle */
    {PAIR(   150,   -300), REST(    41)}, /* middle tip */
    {PAIR(   460,    -95), REST(   -39)}, /* thumb tip + middle tip */
    {PAIR(   105,    -40), REST(    74)}, /* index tip + middle tip */
    {PAIR(   415,    165), REST(    -6)}, /* thumb tip + index tip + middle tip */
    {PAIR(   240,   -312), REST(    34)}, /* index middle + middle tip */
    {PAIR(   550,   -107), REST(   -46)}, /* thumb tip + index middle + middle tip */
    {PAIR(   195,    -52), REST(    67)}, /* index tip + index middle + middle tip */
    {PAIR(   505,    153), REST(   -13)}, /* thumb tip + index tip + index middle + middle tip */
    {PAIR(   400,   -390), REST(  -120)}, /* palm radial */
    {PAIR(   710,   -185), REST(  -200)}, /* thumb tip + palm radial */
    {PAIR(   355,   -130), REST(   -87)}, /* index tip + palm radial */
    {PAIR(   665,     75), REST(  -167)}, /* thumb tip + index tip + palm radial */
    {PAIR(   490,   -402), REST(  -127)}, /* index middle + palm radial */
    {PAIR(   800,   -197), REST(  -207)}, /* thumb tip + index middle + palm radial */
    {PAIR(   445,   -142), REST(   -94)}, /* index tip + index middle + palm radial */
    {PAIR(   755,     63), REST(  -174)}, /* thumb tip + index tip + index middle + palm radial */
    {PAIR(   550,   -690), REST(   -79)}, /* middle tip + palm radial */
    {PAIR(   860,   -485), REST(  -159)}, /* thumb tip + middle tip + palm radial */
    {PAIR(   505,   -430), REST(   -46)}, /* index tip + middle tip + palm radial */
    {PAIR(   815,   -225), REST(  -126)}, /* thumb tip + index tip + middle tip + palm radial */
    {PAIR(   640,   -702), REST(   -86)}, /* index middle + middle tip + palm radial */
    {PAIR(   950,   -497), REST(  -166)}, /* thumb tip + index middle + middle tip + palm radial */
    {PAIR(   595,   -442), REST(   -53)}, /* index tip + index middle + middle tip + palm radial */
    {PAIR(   905,   -237), REST(  -133)}, /* thumb tip + index tip + index middle + middle tip + palm radial */
    {PAIR(    77,     -8), REST(   260)}, /* palm ulnar */
    {PAIR(   387,    197), REST(   180)}, /* thumb tip + palm ulnar */
    {PAIR(    32,    252), REST(   293)}, /* index tip + palm ulnar */
    {PAIR(   342,    457), REST(   213)}, /* thumb tip + index tip + palm ulnar */
    {PAIR(   167,    -20), REST(   253)}, /* index middle + palm ulnar */
    {PAIR(   477,    185), REST(   173)}, /* thumb tip + index middle + palm ulnar */
    {PAIR(   122,    240), REST(   286)}, /* index tip + index middle + palm ulnar */
    {PAIR(   432,    445), REST(   206)}, /* thumb tip + index tip + index middle + palm ulnar */
    {PAIR(   227,   -308), REST(   301)}, /* middle tip + palm ulnar */
    {PAIR(   537,   -103), REST(   221)}, /* thumb tip + middle tip + palm ulnar */
    {PAIR(   182,    -48), REST(   334)}, /* index tip + middle tip + palm ulnar */
    {PAIR(   492,    157), REST(   254)}, /* thumb tip + index tip + middle tip + palm ulnar */
    {PAIR(   317,   -320), REST(   294)}, /* index middle + middle tip + palm ulnar */
    {PAIR(   627,   -115), REST(   214)}, /* thumb tip + index middle + middle tip + palm ulnar */
    {PAIR(   272,    -60), REST(   327)}, /* index tip + index middle + middle tip + palm ulnar */
    {PAIR(   582,    145), REST(   247)}, /* thumb tip + index tip + index middle + middle tip + palm ulnar */
    {PAIR(   477,   -398), REST(   140)}, /* palm radial + palm ulnar */
    {PAIR(   787,   -193), REST(    60)}, /* thumb tip + palm radial + palm ulnar */
    {PAIR(   432,   -138), REST(   173)}, /* index tip + palm radial + palm ulnar */
    {PAIR(   742,     67), REST(    93)}, /* thumb tip + index tip + palm radial + palm ulnar */
    {PAIR(   567,   -410), REST(   133)}, /* index middle + palm radial + palm ulnar */
    {PAIR(   877,   -205), REST(    53)}, /* thumb tip + index middle + palm radial + palm ulnar */
    {PAIR(   522,   -150), REST(   166)}, /* index tip + index middle + palm radial + palm ulnar */
    {PAIR(   832,     55), REST(    86)}, /* thumb tip + index tip + index middle + palm radial + palm ulnar */
    {PAIR(   627,   -698), REST(   181)}, /* middle tip + palm radial + palm ulnar */
    {PAIR(   937,   -493), REST(   101)}, /* thumb tip + middle tip + palm radial + palm ulnar */
    {PAIR(   582,   -438), REST(   214)}, /* index tip + middle tip + palm radial + palm ulnar */
    {PAIR(   892,   -233), REST(   134)}, /* thumb tip + index tip + middle tip + palm radial + palm ulnar */
    {PAIR(   717,   -710), REST(   174)}, /* index middle + middle tip + palm radial + palm ulnar */
    {PAIR(  1027,   -505), REST(    94)}, /* thumb tip + index middle + middle tip + palm radial + palm ulnar */
    {PAIR(   672,   -450), REST(   207)}, /* index tip + index middle + middle tip + palm radial + palm ulnar */
    /* thumb tip + index tip + index middle + middle tip + palm radial + palm ulnar */
    {PAIR(   982,   -245), REST(   127)},

    /* joint 0: thumb_rotation; joint 1: index_pij */
    {PAIR(   580,   -260), REST(  -300)}, /* thumb_rotation above 140, index_pij above 200 */
    {PAIR(   340,    -70), REST(  -210)}, /* thumb_rotation to 140, index_pij above 200 */
    {PAIR(   240,     10), REST(  -160)}, /* thumb_rotation to 61, index_pij above 200 */
    {PAIR(   130,     90), REST(  -150)}, /* thumb_rotation to 60, index_pij above 200 */
    {PAIR(   265,    -40), REST(   -85)}, /* thumb_rotation above 140, index_pij to 200 */
    {PAIR(    25,    150), REST(     5)}, /* thumb_rotation to 140, index_pij to 200 */
    {PAIR(   -75,    230), REST(    55)}, /* thumb_rotation to 61, index_pij to 200 */
    {PAIR(  -185,    310), REST(    65)}, /* thumb_rotation to 60, index_pij to 200 */
    {PAIR(   -60,   -130), REST(   160)}, /* thumb_rotation above 140, index_pij to 90 */
    {PAIR(  -300,     60), REST(   250)}, /* thumb_rotation to 140, index_pij to 90 */
    {PAIR(  -400,    140), REST(   300)}, /* thumb_rotation to 61, index_pij to 90 */
    {PAIR(  -510,    220), REST(   310)}, /* thumb_rotation to 60, index_pij to 90 */
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

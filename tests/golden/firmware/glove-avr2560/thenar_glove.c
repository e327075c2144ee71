/* thenar_glove.c: tables and integer arithmetic; the header says how it is used.
   Layout for atmega2560: 16-bit entries, up to 6 switches a look-up, codes compared with thresholds, up to 2 joints
   a look-up, rows added in line: the fastest of 108 layouts in 49152 bytes of flash, at most 137 cycles (284 by
   update()) and 1648 bytes.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME.c.j2. */
#include "thenar_glove.h"

#define CLASSES THENAR_GLOVE_CLASSES
#define ROWS 76u

#ifdef __AVR__
#include <avr/pgmspace.h>

#define IN_FLASH PROGMEM
#define READ(place) pgm_read_byte(&(place))
#define READ_MEAN(place) pgm_read_word(&(place))

/* A row is an entry for every class; thenar_glove_avr.S adds them up. */
typedef int16_t thenar_glove_row[CLASSES];
#define PAIR(a, b) (a), (b)
#define REST(a) (a)
#else
#define IN_FLASH
#define READ(place) (place)

/* Elsewhere than on an AVR a word holds the entries of two classes, as one sum: they are added up at once. */
#define WORDS 2u
typedef uint32_t thenar_glove_row[WORDS];
#define PAIR(a, b) ((uint32_t)(int32_t)(a) + ((uint32_t)(int32_t)(b) << 16))
#define REST(a) PAIR(a, 0)
#endif

extern const thenar_glove_row thenar_glove_rows[ROWS];

const thenar_glove_row thenar_glove_rows[ROWS] IN_FLASH = {
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

static const char names[CLASSES + 1u][14] IN_FLASH = {
    "power grip",
    "tip pinch",
    "lateral pinch",
    "",
};

/* Where the input has each switch: byte and bit. */
static const struct {
    uint8_t port;
    uint8_t bit;
} places[THENAR_GLOVE_SWITCHES] IN_FLASH = {
    {0, 1}, {0, 2}, {0, 4}, {0, 8}, {0, 16}, {0, 32},
};

/* What an input adds while it is missing, beyond what it does open or at code 0: switches, then joints. */
static const int16_t means[8][CLASSES] IN_FLASH = {
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {155, 102, -40},
    {201, -178, -87},
    {314, -35, -214},
};

thenar_glove_frame thenar_glove_input;

/* Until something else is classified, all switches are open and all codes 0. */
int16_t thenar_glove_scores[CLASSES] = {
    -390, 180, 317,
};

void thenar_glove_set_switch(thenar_glove_switch number, bool closed)
{
    if (number < THENAR_GLOVE_SWITCHES) {
        uint8_t *port = &thenar_glove_input.switches[READ(places[number].port)];
        const uint8_t bit = READ(places[number].bit);

        *port = (uint8_t)(closed ? (*port | bit) : (*port & (uint8_t)~bit));
    }
}

/* What is missing, laid out as the input, and how many of both. */
static uint8_t lost_switches[THENAR_GLOVE_PORTS];
static uint8_t lost_joints[(THENAR_GLOVE_JOINTS + 7u) / 8u];
static uint16_t n_lost;
#ifdef __AVR__
/* While something is missing, what begins an answer; where nothing ever is, the linker leaves all of that out. */
extern uint8_t thenar_glove_missing;
extern void (*thenar_glove_stand_in)(void);
extern int16_t thenar_glove_start[CLASSES];
uint8_t thenar_glove_missing;
void (*thenar_glove_stand_in)(void);

int16_t thenar_glove_start[CLASSES] = {
    120, -40, 7,
};
#endif

const char *thenar_glove_grasp(thenar_glove_class grasp)
{
    return names[(grasp < CLASSES) ? grasp : CLASSES];
}

#ifdef __AVR__
void thenar_glove_start_without(void);
void thenar_glove_leave_out(void);

/* Open the switches that are missing, and make the codes of such joints 0. */
void thenar_glove_leave_out(void)
{
    for (uint16_t port = 0u; port < THENAR_GLOVE_PORTS; port++) {
        thenar_glove_input.switches[port] &= (uint8_t)~lost_switches[port];
    }
    for (uint16_t joint = 0u; joint < THENAR_GLOVE_JOINTS; joint++) {
        if ((lost_joints[joint / 8u] & (1u << (joint % 8u))) != 0u) {
            thenar_glove_input.codes[joint] = 0u;
        }
    }
}

/* Take the mean of an input that is missing into the scores, and into those that classify() begins with; or out. */
static void replace_by_mean(uint16_t input, bool lost)
{
    for (uint16_t k = 0u; k < CLASSES; k++) {
        const uint16_t mean = (uint16_t)(int16_t)READ_MEAN(means[input][k]);
        const uint16_t steps = (uint16_t)(lost ? mean : (0u - mean));
        const uint16_t score = (uint16_t)thenar_glove_scores[k];
        const uint16_t first = (uint16_t)thenar_glove_start[k];
        const uint16_t moved = (uint16_t)(score + steps);
        const uint16_t first_moved = (uint16_t)(first + steps);

        thenar_glove_scores[k] = (int16_t)moved;
        thenar_glove_start[k] = (int16_t)first_moved;
    }
    if (lost) {
        n_lost++;
    } else {
        n_lost--;
    }
    thenar_glove_missing = (n_lost > 0u) ? 1u : 0u;
    thenar_glove_stand_in = thenar_glove_start_without;
}
#else
#define LOOKUPS 2u
#define LANES 2u /* words of two sums */

/* Sums begin 2^15 too high, so that no lane is negative in the end, when all have taken what they borrowed. */
#define LANE(start, shift) (((uint32_t)(int32_t)(start) + 32768u) << (shift))
#define START(a, b) (LANE(a, 0) + LANE(b, 16))

static uint32_t start[LANES] = {
    START(120, -40), START(7, 0),
};

/* What is in the sums of update(), once it has begun: after classify() it begins anew. */
static bool begun;
static const thenar_glove_row *added[LOOKUPS];
static const thenar_glove_row nothing = {0u, 0u};
static uint32_t sums[LANES];

/* Open the switches that are missing, and make the codes of such joints 0. */
static void leave_out(void)
{
    for (uint16_t port = 0u; port < THENAR_GLOVE_PORTS; port++) {
        thenar_glove_input.switches[port] &= (uint8_t)~lost_switches[port];
    }
    for (uint16_t joint = 0u; joint < THENAR_GLOVE_JOINTS; joint++) {
        if ((lost_joints[joint / 8u] & (1u << (joint % 8u))) != 0u) {
            thenar_glove_input.codes[joint] = 0u;
        }
    }
}

/* Add a row to the sums. */
#define ADD(row) do { \
    s0 += (row)[0]; \
    s1 += (row)[1]; \
} while (0)

static void find_rows(const thenar_glove_row **row)
{
    const uint8_t *const ports = thenar_glove_input.switches;

    row[0] = &thenar_glove_rows[(ports[0] & 0x3Fu)];
    row[1] = &thenar_glove_rows[64u + (uint32_t)((thenar_glove_input.codes[0] <= 60u) +
        (thenar_glove_input.codes[0] <= 61u) + (thenar_glove_input.codes[0] <=
        140u)) + (4u * (uint32_t)((thenar_glove_input.codes[1] <= 90u) +
        (thenar_glove_input.codes[1] <= 200u)))];
}

/* The first class of the largest sum: that sum in the upper bits of a word, and ones below. */
typedef struct {
    uint32_t sum;
    uint_fast16_t grasp;
} largest;

/* Two scores in the place of two sums; and what is in the lowest sixteen bits is stored. */
#define SCORES(sums) ((sums) ^ 0x80008000u)

static void store(uint32_t lane, uint_fast16_t k)
{
    thenar_glove_scores[k] = (int16_t)(uint16_t)(lane & 0xFFFFu);
}

/* Take the upper bits of the word, the sum of class k, for the largest sum if it is. */
static void take(uint32_t word, uint_fast16_t k, largest *best)
{
    if (word > best->sum) {
        best->sum = word | 0xFFFFu;
        best->grasp = k;
    }
}

/* Add up the sums, and take them. */
static void add_up(const thenar_glove_row *const *row, largest *best)
{
    uint32_t s0 = start[0];
    uint32_t s1 = start[1];

    ADD(*row[0]);
    ADD(*row[1]);
    store(SCORES(s0), 0u);
    store(SCORES(s0) >> 16, 1u);
    store(SCORES(s1), 2u);
    take(s0 << 16, 0u, best);
    take(s0, 1u, best);
    take(s1 << 16, 2u, best);
}

thenar_glove_class thenar_glove_classify(void)
{
    largest best = {0u, 0u};
    const thenar_glove_row *row[LOOKUPS];

    begun = false;
    if (n_lost > 0u) {
        leave_out();
    }
    find_rows(row);
    add_up(row, &best);
    return (thenar_glove_class)best.grasp;
}

/* Replace a row in the sums. */
static void replace(const uint32_t *before, const uint32_t *after, uint32_t *sum)
{
    sum[0] += after[0] - before[0];
    sum[1] += after[1] - before[1];
}

static void begin(void)
{
    for (uint_fast16_t lane = 0u; lane < LANES; lane++) {
        sums[lane] = start[lane];
    }
    for (uint_fast16_t i = 0u; i < LOOKUPS; i++) {
        added[i] = &nothing;
    }
    begun = true;
}

static void answer(const uint32_t *sum, largest *best)
{
    const uint32_t s0 = sum[0];
    const uint32_t s1 = sum[1];

    store(SCORES(s0), 0u);
    store(SCORES(s0) >> 16, 1u);
    store(SCORES(s1), 2u);
    take(s0 << 16, 0u, best);
    take(s0, 1u, best);
    take(s1 << 16, 2u, best);
}

thenar_glove_class thenar_glove_update(void)
{
    largest best = {0u, 0u};
    const thenar_glove_row *now[LOOKUPS];

    if (n_lost > 0u) {
        leave_out();
    }
    if (!begun) {
        begin();
    }
    find_rows(now);
    for (uint_fast16_t i = 0u; i < LOOKUPS; i++) {
        if (now[i] != added[i]) {
            replace(*added[i], *now[i], sums);
            added[i] = now[i];
        }
    }
    answer(sums, &best);
    return (thenar_glove_class)best.grasp;
}

/* Add steps to the score of a class from now on, and to what classify() begins with. */
static void shift_score(uint16_t k, uint32_t steps)
{
    const uint32_t shifted = steps << (16u * (k % 2u));
    const uint16_t lane = (uint16_t)(k / 2u);

    start[lane] += shifted;
    sums[lane] += shifted;
}

/* Take the mean of an input that is missing into the scores, or out of them. */
static void replace_by_mean(uint16_t input, bool lost)
{
    for (uint16_t k = 0u; k < CLASSES; k++) {
        const uint32_t mean = (uint32_t)(int32_t)means[input][k];

        shift_score(k, lost ? mean : (0u - mean));
    }
    if (lost) {
        n_lost++;
    } else {
        n_lost--;
    }
}
#endif

void thenar_glove_lose_switch(thenar_glove_switch number, bool lost)
{
    if (number < THENAR_GLOVE_SWITCHES) {
        uint8_t *port = &lost_switches[READ(places[number].port)];
        const uint8_t bit = READ(places[number].bit);

        if (((*port & bit) != 0u) != lost) {
            *port ^= bit;
            replace_by_mean(number, lost);
        }
    }
}

void thenar_glove_lose_joint(uint16_t number, bool lost)
{
    if (number < THENAR_GLOVE_JOINTS) {
        uint8_t *eight = &lost_joints[number / 8u];
        const uint8_t bit = (uint8_t)(1u << (number % 8u));

        if (((*eight & bit) != 0u) != lost) {
            *eight ^= bit;
            replace_by_mean((uint16_t)(6u + number), lost);
        }
    }
}

/* Conversion of readings to codes; the header describes its use.

   thenar 0.1.0, template codes/thenar_NAME_codes.c.j2. */
#include "thenar_glove_codes.h"

#ifdef __AVR__
#define COPY(to, from) ((void)memcpy_P(&(to), &(from), sizeof(to)))
#define APART __attribute__((noinline)) /* a short function then saves few registers */
#else
#define APART
#define COPY(to, from) ((to) = (from))
#endif

#define SENSORS THENAR_GLOVE_SENSORS
#define FARTHEST 65535
#define FRACTION 24u /* fractional bits of a point's code */

/* The codes of the two points of each sensor. */
typedef struct {
    int64_t first;
    int64_t second;
} point_codes;

static const point_codes points[SENSORS] THENAR_FLASH = {
    {INT64_C(16777216), INT64_C(4278190080)},
    {INT64_C(16777216), INT64_C(4278190080)},
};

typedef struct {
    int32_t first;
    int32_t second;
} point_readings;

static const point_readings known[SENSORS] THENAR_FLASH = {
    {0, 0},
    {0, 0},
};

/* Return the nearest code on the line through two points, rounding half to even, 0 to `most`. */
static uint16_t nearest(const point_readings *at, const point_codes *codes, int32_t reading, uint16_t most)
{
    const bool rises = at->first < at->second;
    const int32_t begin = rises ? at->first : at->second;
    const int32_t span = (rises ? at->second : at->first) - begin;
    const int64_t low = rises ? codes->first : codes->second;
    const int64_t high = rises ? codes->second : codes->first;
    const int32_t held = (reading < -FARTHEST) ? -FARTHEST : ((reading > FARTHEST) ? FARTHEST : reading);
    /* The code, and a half, times the span. */
    const int64_t half = (int64_t)span * 8388608;
    const int64_t sum = (low * span) + ((high - low) * ((int64_t)held - begin)) + half;
    uint32_t code = 0u;

    if (sum >= 0) {
        const uint64_t whole = (uint64_t)sum >> FRACTION;
        const uint32_t divisor = (uint32_t)span;

        if (whole >= ((uint64_t)divisor << 16)) {
            code = most;
        } else {
            const uint32_t times = (uint32_t)whole;

            code = times / divisor;
            if (((code * divisor) == times) && ((whole << FRACTION) == (uint64_t)sum)) {
                code -= code & 1u; /* halfway between two */
            }
        }
    }
    return (code < most) ? (uint16_t)code : most;
}

#define HIGHEST_VALUE 0xFE000000u /* leaves room for an offset */

/* Prepare the fast range: the code of a reading is `base` plus the upper bits of offset + gain * (reading - from).
   Offset and gain are rounded down. Fractions that this could change, and codes midway, are left to nearest(). */
static void prepare(thenar_glove_line *line, const point_codes *codes)
{
    const bool rises = line->readings[0] < line->readings[1];
    const int32_t begin = line->readings[rises ? 0 : 1];
    const int32_t span = line->readings[rises ? 1 : 0] - begin;
    const int64_t low = rises ? codes->first : codes->second;
    const int64_t step = (rises ? codes->second : codes->first) - low;
    const uint64_t steep = (uint64_t)((step < 0) ? -step : step) / (uint64_t)span;
    const int64_t unit = (int64_t)span * (INT64_C(1) << FRACTION);

    line->window = 4u;
    while ((line->window < ((uint32_t)span * 4u)) && (line->window < 131072u)) {
        line->window *= 2u;
    }
    line->falls = step < 0;
    line->from = begin + (line->falls ? (int32_t)(line->window / 2u) : -(int32_t)(line->window / 2u));
    line->from = (line->from < -FARTHEST) ? -FARTHEST : ((line->from > FARTHEST) ? FARTHEST : line->from);
    const uint32_t to_end = (uint32_t)(line->falls ? (line->from + FARTHEST) : (FARTHEST - line->from));
    line->window = (line->window > to_end) ? to_end : line->window;
    const int64_t at_from = (low * span) + (step * ((int64_t)line->from - begin)) + (unit / 2);
    const int64_t rest = ((at_from % unit) + unit) % unit;

    line->base = (int32_t)((at_from - rest) / unit);
    line->shift = 8u;
    while ((line->shift > 0u) && (((steep * line->window) >> (8u - line->shift)) >= HIGHEST_VALUE)) {
        line->shift--;
    }
    line->offset = (uint32_t)(((uint64_t)rest / (uint64_t)span) >> (8u - line->shift));
    line->gain = (uint32_t)(steep >> (8u - line->shift));
    line->mask = ((uint32_t)0x10000u << line->shift) - 1u;
    const uint32_t inexact = (2u * line->window) + 2u;

    if ((((steep * line->window) >> (8u - line->shift)) < HIGHEST_VALUE) && (line->mask > inexact)) {
        const uint64_t dropped = (uint64_t)((1u << (8u - line->shift)) - 1u);

        line->exact = ((step % span) == 0) && (((steep | ((uint64_t)rest / (uint64_t)span)) & dropped) == 0u);
        line->safe = line->exact ? UINT32_MAX : (line->mask - inexact);
    }
}

static APART uint16_t nearest_on(const thenar_glove_line *line, uint16_t sensor, int32_t reading)
{
    const point_readings at = {line->readings[0], line->readings[1]};
    point_codes own;

    COPY(own, points[sensor]);
    return (at.first == at.second) ? 0u : nearest(&at, &own, reading, UINT16_MAX);
}

/* Return the code of a reading in the units of the readings at the points. */
static APART uint16_t code_on(const thenar_glove_line *line, uint16_t sensor, int32_t reading)
{
    const uint32_t above = (uint32_t)reading - (uint32_t)line->from;
    const uint32_t distance = line->falls ? (0u - above) : above;

    if (distance <= line->window) {
        const uint32_t value = line->offset + (line->gain * distance);
        const uint32_t rest = value & line->mask;
        const bool midway = (rest == 0u) && line->exact;

        if (((rest - 1u) < line->safe) || midway) {
            int32_t whole = line->base;

            /* An AVR shifts by one bit at a time, but a byte at once. */
            whole += (line->shift == 8u) ? (uint8_t)(value >> 24) : ((uint16_t)(value >> 16) >> line->shift);
            whole -= midway ? (int32_t)((uint32_t)whole & 1u) : 0;
            return (whole < 0) ? 0u : ((whole > UINT16_MAX) ? UINT16_MAX : (uint16_t)whole);
        }
    }
    return nearest_on(line, sensor, reading);
}

#define coded(sensor, reading) (reading)

static void set_line(thenar_glove_codes *codes, uint16_t sensor, int32_t first, int32_t second)
{
    thenar_glove_line *const line = &codes->lines[sensor];

    *line = (thenar_glove_line){.readings = {first, second}};
    if (first != second) {
        point_codes own;

        COPY(own, points[sensor]);
        prepare(line, &own);
    }
}

void thenar_glove_codes_init(thenar_glove_codes *codes)
{
    for (uint16_t sensor = 0u; sensor < SENSORS; ++sensor) {
        point_readings own;

        COPY(own, known[sensor]);
        set_line(codes, sensor, own.first, own.second);
    }
}

bool thenar_glove_calibrate(thenar_glove_codes *codes, uint16_t sensor, int32_t at_first, int32_t at_second)
{
    bool line = sensor < SENSORS;

    if (line) {
        const int32_t first = coded(sensor, at_first);
        const int32_t second = coded(sensor, at_second);
        const bool near = (first >= -FARTHEST) && (first <= FARTHEST) && (second >= -FARTHEST) && (second <= FARTHEST);

        line = near && (first != second) && ((first - second) <= FARTHEST) && ((second - first) <= FARTHEST);
        if (line) {
            set_line(codes, sensor, first, second);
        }
    }
    return line;
}

bool thenar_glove_calibrated(const thenar_glove_codes *codes, uint16_t sensor)
{
    return (sensor < SENSORS) && (codes->lines[sensor].readings[0] != codes->lines[sensor].readings[1]);
}

uint16_t thenar_glove_code_of(const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    return (sensor < SENSORS) ? code_on(&codes->lines[sensor], sensor, coded(sensor, reading)) : 0u;
}

void thenar_glove_set_reading(thenar *hand, const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    const uint16_t code = thenar_glove_code_of(codes, sensor, reading);

    if (sensor < THENAR_GLOVE_JOINTS) {
        thenar_set_code(hand, sensor, code);
    }
}

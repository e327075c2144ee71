/* Conversion of readings to codes; the header describes its use.

   thenar 0.1.0, template codes/thenar_NAME_codes.c.j2. */
#include "thenar_glove_codes.h"

#ifdef __AVR__
#define COPY(to, from) ((void)memcpy_P(&(to), &(from), sizeof(to)))
#else
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

/* Return a reading in the units of the readings at the points. */
static int32_t coded(uint16_t sensor, int32_t reading)
{
    int32_t found = reading;

    (void)sensor;
    return found;
}

void thenar_glove_codes_init(thenar_glove_codes *codes)
{
    for (uint16_t sensor = 0u; sensor < SENSORS; ++sensor) {
        point_readings own;

        COPY(own, known[sensor]);
        codes->readings[sensor][0] = own.first;
        codes->readings[sensor][1] = own.second;
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
            codes->readings[sensor][0] = first;
            codes->readings[sensor][1] = second;
        }
    }
    return line;
}

bool thenar_glove_calibrated(const thenar_glove_codes *codes, uint16_t sensor)
{
    return (sensor < SENSORS) && (codes->readings[sensor][0] != codes->readings[sensor][1]);
}

uint16_t thenar_glove_code_of(const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    uint16_t code = 0u;

    if (thenar_glove_calibrated(codes, sensor)) {
        const point_readings at = {codes->readings[sensor][0], codes->readings[sensor][1]};
        point_codes own;

        COPY(own, points[sensor]);
        code = nearest(&at, &own, coded(sensor, reading), UINT16_MAX);
    }
    return code;
}

void thenar_glove_set_reading(thenar *hand, const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    const uint16_t code = thenar_glove_code_of(codes, sensor, reading);

    if (sensor < THENAR_GLOVE_JOINTS) {
        thenar_set_code(hand, sensor, code);
    }
}

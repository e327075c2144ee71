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

/* Divide and round down. */
static int64_t divided(int64_t sum, int64_t divisor)
{
    return (sum / divisor) - (((sum % divisor) < 0) ? 1 : 0);
}

/* Return the nearest code, 0 to 65535, where a sum of codes and a half is in units of `unit`; the even one of two. */
static uint16_t nearest(int64_t sum, int64_t unit)
{
    const int64_t code = divided(sum, unit);
    const int64_t even = ((code * unit) == sum) ? (code - (code % 2)) : code;

    return (even < 0) ? 0u : ((even > UINT16_MAX) ? UINT16_MAX : (uint16_t)even);
}

/* Return the first reading, -FARTHEST to FARTHEST, whose sum has crossed a limit: that of -FARTHEST is so far above. */
static int32_t crossing(int64_t above, int64_t step, bool rises)
{
    const int64_t after = rises ? -divided(above, step) : (divided(above, -step) + 1);

    return (int32_t)((after < 0) ? 0 : ((after > (2 * FARTHEST)) ? (2 * FARTHEST) : after)) - FARTHEST;
}

/* Set the line through two points. Sums are as for nearest(); they grow by `step` with each reading. */
static void set_line(thenar_glove_line *line, uint16_t sensor, int32_t first, int32_t second)
{
    const bool forward = first < second;
    const int32_t begin = forward ? first : second;
    const int32_t span = (forward ? second : first) - begin;
    const int64_t unit = (int64_t)span * 16777216;
    point_codes own;

    COPY(own, points[sensor]);
    const bool rises = forward == (own.first < own.second);
    const int64_t step = forward ? (own.second - own.first) : (own.first - own.second);
    const int64_t sum = ((forward ? own.first : own.second) * span) + (unit / 2) - (step * begin);
    const int64_t lowest = sum - (step * FARTHEST);
    const int64_t above = lowest - (unit * 65536);
    const int64_t gain = divided(step * 256, span);

    line->beyond[0] = nearest(lowest, unit);
    line->beyond[1] = nearest(sum + (step * FARTHEST), unit);
    line->first = crossing(rises ? lowest : above, step, rises);
    line->last = crossing(rises ? above : lowest, step, rises) - 1;
    line->gain = (uint32_t)(((uint64_t)gain >> 16) & UINT32_MAX);
    line->fine = (uint16_t)((uint64_t)gain & UINT16_MAX);
    line->offset = (uint32_t)((uint64_t)(divided(sum, (int64_t)span * 256) + 3) & UINT32_MAX);
    line->sum = (uint32_t)((uint64_t)sum & UINT32_MAX);
    line->step = (uint32_t)((uint64_t)step & UINT32_MAX);
    line->span = (uint16_t)span;
    line->calibrated = true;
}

/* Return the code, or the one below: how far the sum is past midway between both decides, and 32 bits hold that. */
static APART uint16_t settled(const thenar_glove_line *line, uint16_t reading, bool below, uint16_t code)
{
    const uint32_t steps = line->step * reading;
    const uint32_t sum = below ? (line->sum - steps) : (line->sum + steps);
    const uint32_t past = sum - ((uint32_t)(uint8_t)((uint8_t)line->span * (uint8_t)code) << 24);

    return (uint16_t)(code - ((past == 0u) ? (code & 1u) : (past >> 31)));
}

/* Return the code of a reading, or of as much below 0, by the whole gain. The value is less than 5 * 2^-16 too high. */
static APART uint16_t exact_code(const thenar_glove_line *line, uint16_t reading, bool below)
{
    const uint32_t product = (line->gain * reading) + (((uint32_t)line->fine * reading) >> 16);
    const uint32_t value = below ? (line->offset - product) : (line->offset + product);
    const uint16_t code = (uint16_t)(value >> 16);

    return ((uint16_t)(value & 0xffffu) < 5u) ? settled(line, reading, below, code) : code;
}

/* Return the code of a reading of 0 or more. The value is too high by 3 * 2^-16 at most, and too low by at most as many
   2^-16 as the reading has units; that seldom matters. */
static APART uint16_t code_above(const thenar_glove_line *line, uint16_t reading)
{
    const uint32_t value = (line->gain * reading) + line->offset;
    const bool sure = (uint16_t)((value & 0xffffu) - 4u) < (uint16_t)(UINT16_MAX - reading);

    return sure ? (uint16_t)(value >> 16) : exact_code(line, reading, false);
}

/* Return the code of a reading in the units of the readings at the points. */
static APART uint16_t code_on(const thenar_glove_line *line, int32_t reading)
{
    uint16_t code;

    if (reading < line->first) {
        code = line->beyond[0];
    } else if (reading > line->last) {
        code = line->beyond[1];
    } else if (reading < 0) {
        code = exact_code(line, (uint16_t)-reading, true);
    } else {
        code = code_above(line, (uint16_t)reading);
    }
    return code;
}
#define coded(sensor, reading) (reading)

void thenar_glove_codes_init(thenar_glove_codes *codes)
{
    for (uint16_t sensor = 0u; sensor < SENSORS; ++sensor) {
        point_readings own;

        codes->lines[sensor] = (thenar_glove_line){0};
        COPY(own, known[sensor]);
        if (own.first != own.second) {
            set_line(&codes->lines[sensor], sensor, own.first, own.second);
        }
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
            set_line(&codes->lines[sensor], sensor, first, second);
        }
    }
    return line;
}

bool thenar_glove_calibrated(const thenar_glove_codes *codes, uint16_t sensor)
{
    return (sensor < SENSORS) && (codes->lines[sensor].calibrated);
}

uint16_t thenar_glove_code_of(const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    return (sensor < SENSORS) ? code_on(&codes->lines[sensor], coded(sensor, reading)) : 0u;
}

void thenar_glove_set_reading(thenar *hand, const thenar_glove_codes *codes, uint16_t sensor, int32_t reading)
{
    if (sensor < THENAR_GLOVE_JOINTS) {
        thenar_set_code(hand, sensor, code_on(&codes->lines[sensor], coded(sensor, reading)));
    }
}

/* thenar_glove.c: integer arithmetic; the header describes its use.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME.c.j2. */
#include "thenar_glove_tables.h"

void thenar_glove_init(thenar_glove *glove)
{
    uint8_t *const bytes = (uint8_t *)glove;

    for (uint16_t at = 0u; at < sizeof *glove; at++) {
        bytes[at] = 0u;
    }
#ifdef __AVR__
    for (uint16_t k = 0u; k < CLASSES; k++) {
        glove->start[k] = (int16_t)READ_WORD(thenar_glove_start[k]);
    }
#else
    for (uint_fast16_t part = 0u; part < PARTS; part++) {
        for (uint_fast16_t lane = 0u; lane < LANES; lane++) {
            glove->start[part][lane] = thenar_glove_start[part][lane];
        }
    }
#endif
}

void thenar_glove_set_switch(thenar_glove *glove, thenar_glove_switch number, bool closed)
{
    if (number < THENAR_GLOVE_SWITCHES) {
        uint8_t *const port = &glove->input.switches[READ_BYTE(thenar_glove_places[number].port)];
        const uint8_t bit = READ_BYTE(thenar_glove_places[number].bit);

        *port = (uint8_t)(closed ? (*port | bit) : (*port & (uint8_t)~bit));
    }
}

const char *thenar_glove_grasp(thenar_glove_class grasp)
{
    return thenar_glove_names[(grasp < 3u) ? grasp : 3u];
}

uint16_t thenar_glove_margin(const thenar_glove *glove)
{
    int16_t best = glove->scores[0];
    int16_t second = INT16_MIN;

    for (uint16_t k = 1u; k < CLASSES; k++) {
        const int16_t score = glove->scores[k];

        if (score > best) {
            second = best;
            best = score;
        } else if (score > second) {
            second = score;
        } else {
            /* no second best */
        }
    }
    return (uint16_t)((uint16_t)best - (uint16_t)second);
}

uint16_t thenar_glove_probability(const thenar_glove *glove, thenar_glove_class grasp)
{
    int16_t best = INT16_MIN;
    uint32_t own = 0u;
    uint32_t all = 0u;

    for (uint16_t k = 0u; k < CLASSES; k++) {
        best = (glove->scores[k] > best) ? glove->scores[k] : best;
    }
    for (uint16_t k = 0u; k < CLASSES; k++) {
        /* The lag, in 64ths of a halving of the probability, and the rest in 256ths of such a step. */
        const uint16_t behind = (uint16_t)((uint16_t)best - (uint16_t)glove->scores[k]);
        const uint32_t steps = (uint32_t)behind * 60511u;
        const uint32_t halves = steps >> 22;

        if (halves < 16u) {
            const uint8_t at = (uint8_t)((steps >> 16) & 63u);
            const uint32_t above = READ_WORD(thenar_glove_powers[at]);
            const uint32_t below = READ_WORD(thenar_glove_powers[at + 1u]);
            const uint32_t between = (steps >> 8) & 255u;
            const uint32_t power = (above - (((above - below) * between) >> 8)) >> halves;

            all += power;
            own = (k == grasp) ? power : own;
        }
    }
    return (uint16_t)(((own * 65535u) + (all / 2u)) / all);
}

/* Open the missing switches, and set the codes of missing joints to 0. */
#ifdef __AVR__
void thenar_glove_leave_out(thenar_glove *glove);
#define LEAVE_OUT void thenar_glove_leave_out
#else
#define LEAVE_OUT static void leave_out
#endif
LEAVE_OUT(thenar_glove *glove)
{
    for (uint16_t port = 0u; port < THENAR_GLOVE_PORTS; port++) {
        glove->input.switches[port] &= (uint8_t)~glove->lost_switches[port];
    }
    for (uint16_t joint = 0u; joint < THENAR_GLOVE_JOINTS; joint++) {
        if ((glove->lost_joints[joint / 8u] & (1u << (joint % 8u))) != 0u) {
            glove->input.codes[joint] = 0u;
        }
    }
}

#ifdef __AVR__
/* The function that does this while an input is missing; without missing inputs the linker leaves it out. */
extern void (*thenar_glove_stand_in)(void);
void (*thenar_glove_stand_in)(void);
void thenar_glove_start_without(void);

static void shift_start(thenar_glove *glove, uint16_t k, uint16_t steps)
{
    const uint16_t first = (uint16_t)glove->start[k];
    const uint16_t moved = (uint16_t)(first + steps);

    glove->start[k] = (int16_t)moved;
    thenar_glove_stand_in = thenar_glove_start_without;
}
#else
/* Compilers that may reorder lookups load many rows before they add one, and run out of registers; and if they know the
   size or the place of a row, they compute its address in more steps than a product takes. A core of ARMv6-M has too
   few registers to gain from this: there all rows are found first. */
#if defined(__GNUC__) && !defined(__ARM_ARCH_6M__)
#define HIDE(value) __asm volatile("" : "+r"(value))
#else
#define HIDE(value) ((void)0)
#endif
/* RISC-V needs two instructions for a large constant, so it is kept in a register. */
#if defined(__GNUC__) && defined(__riscv)
#define KEEP(constant) HIDE(constant)
#else
#define KEEP(constant) ((void)0)
#endif

/* The first class of the largest sum: that sum in the upper bits of a word, and ones below. */
typedef struct {
    uint32_t sum;
    uint_fast16_t grasp;
} largest;

/* Store the lower sum of a word as a score. */
static void store(uint32_t sums, int16_t *score)
{
    *score = (int16_t)(uint16_t)((sums ^ 0x8000u) & 0xFFFFu);
}

/* Store both sums of a word as scores, in one access if the second comes last in memory. */
static void store_two(uint32_t sums, int16_t *score)
{
    const uint32_t scores = sums ^ 0x80008000u;

#if defined(__GNUC__) && (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__)
    __builtin_memcpy(__builtin_assume_aligned(score, sizeof scores), &scores, sizeof scores);
#else
    score[0] = (int16_t)(uint16_t)(scores & 0xFFFFu);
    score[1] = (int16_t)(uint16_t)(scores >> 16);
#endif
}

/* Make the upper bits of the word, the sum of class k, the largest sum if they are. */
static void take(uint32_t word, uint_fast16_t k, uint32_t ones, largest *best)
{
    if (word > best->sum) {
        best->sum = word | ones;
        best->grasp = k;
    }
}

/* Store the sums of a part as scores, and update the largest sum. */
#define PREDICT(first, best) do { \
    uint32_t ones = 0xFFFFu; \
    KEEP(ones); \
    HIDE(s0); \
    store_two(s0, &glove->scores[0]); \
    store(s1, &glove->scores[(first) + 2u]); \
    take(s0 << 16, (first) + 0u, ones, (best)); \
    take(s0, (first) + 1u, ones, (best)); \
    take(s1 << 16, (first) + 2u, ones, (best)); \
} while (false)

#ifdef __ARM_ARCH_6M__
#define ROW(lookup, number) found.rows[lookup]
#else
#define ROW(lookup, number) \
    ((const uint32_t *)(const void *)((const uint8_t *)thenar_glove_rows + (row_bytes * (uint32_t)(number))))
#endif

/* Add a row to the sums. */
#define ADD(row) do { \
    const uint32_t *entry = (row); \
    HIDE(entry); \
    s0 += entry[0]; \
    HIDE(s0); \
    s1 += entry[1]; \
    HIDE(s1); \
} while (false)

/* Replace a row in the sums. */
#define REPLACE(before, after) do { \
    s0 += (after)[0] - (before)[0]; \
    HIDE(s0); \
    s1 += (after)[1] - (before)[1]; \
    HIDE(s1); \
} while (false)

/* To replace more rows than these takes longer than to add all. */
#define MOST_REPLACED (LOOKUPS / 2u)

/* Add the initial scores to the sums. */
#define ADD_START(start) do { \
    s0 += (start)[0]; \
    s1 += (start)[1]; \
} while (false)

/* Begin the sums with the initial scores, and add all rows that have been found. */
#define ADD_AGAIN(start) do { \
    s0 = (start)[0]; \
    s1 = (start)[1]; \
    for (uint_fast16_t i = 0u; i < LOOKUPS; i++) { \
        ADD(&glove->seen.rows[i][part * ROWS * WORDS]); \
    } \
} while (false)

#ifdef __ARM_ARCH_6M__
/* Find the rows that an input adds. */
static void find(const thenar_glove_frame *input, thenar_glove_seen *found)
{
    found->rows[0] = thenar_glove_rows[(input->switches[0] & 0x07u)];
    found->rows[1] = thenar_glove_rows[8u + ((((uint32_t)input->switches[0] >> 3) & 0x07u))];
    found->rows[2] = thenar_glove_rows[16u + ((input->codes[0] <= 60u) ? 1u : 0u)
        + ((input->codes[0] <= 61u) ? 1u : 0u)
        + ((input->codes[0] <= 140u) ? 1u : 0u)];
    found->rows[3] = thenar_glove_rows[20u + ((input->codes[1] <= 90u) ? 1u : 0u)
        + ((input->codes[1] <= 200u) ? 1u : 0u)];
}

#endif

static void add_up(thenar_glove *glove, largest *best)
{
    const uint32_t *const start = glove->start[0];
    const thenar_glove_frame *const input = &glove->input;
#ifdef __ARM_ARCH_6M__
    thenar_glove_seen found;
#else
    uint32_t row_bytes = sizeof(thenar_glove_row);
#endif
    uint32_t s0 = 0u;
    uint32_t s1 = 0u;

#ifdef __ARM_ARCH_6M__
    find(input, &found);
#else
    HIDE(row_bytes);
#endif
    ADD(ROW(0, (input->switches[0] & 0x07u)));
    ADD(ROW(1, 8u + ((((uint32_t)input->switches[0] >> 3) & 0x07u))));
    ADD(ROW(2, 16u + ((input->codes[0] <= 60u) ? 1u : 0u)
            + ((input->codes[0] <= 61u) ? 1u : 0u)
            + ((input->codes[0] <= 140u) ? 1u : 0u)));
    ADD(ROW(3, 20u + ((input->codes[1] <= 90u) ? 1u : 0u)
            + ((input->codes[1] <= 200u) ? 1u : 0u)));
    ADD_START(start);
    PREDICT(0u, best);
}

thenar_glove_class thenar_glove_classify(thenar_glove *glove)
{
    largest best = {0u, 0u};

    glove->begun = false;
    if (glove->missing) {
        leave_out(glove);
    }
    add_up(glove, &best);
    return (thenar_glove_class)best.grasp;
}

/* The changes since the last update(). */
typedef struct {
    const uint32_t *before;
    const uint32_t *after;
} change;

typedef struct {
    change rows[LOOKUPS];
    change *end;
    bool again; /* adding up all rows is faster */
} changes;

#define NOTE(lookup, row) do { \
    const uint32_t *const after = (row); \
    if (after != glove->seen.rows[lookup]) { \
        end->before = glove->seen.rows[lookup]; \
        end->after = after; \
        end++; \
        glove->seen.rows[lookup] = after; \
    } \
} while (false)

static void find_changes(thenar_glove *glove, changes *changed)
{
    const thenar_glove_frame *const input = &glove->input;
#ifdef __ARM_ARCH_6M__
    thenar_glove_seen found;
#else
    uint32_t row_bytes = sizeof(thenar_glove_row);
#endif
    change *end = changed->rows;

#ifdef __ARM_ARCH_6M__
    find(input, &found);
#else
    HIDE(row_bytes);
#endif
    NOTE(0, ROW(0, (input->switches[0] & 0x07u)));
    NOTE(1, ROW(1, 8u + ((((uint32_t)input->switches[0] >> 3) & 0x07u))));
    NOTE(2, ROW(2, 16u + ((input->codes[0] <= 60u) ? 1u : 0u)
            + ((input->codes[0] <= 61u) ? 1u : 0u)
            + ((input->codes[0] <= 140u) ? 1u : 0u)));
    NOTE(3, ROW(3, 20u + ((input->codes[1] <= 90u) ? 1u : 0u)
            + ((input->codes[1] <= 200u) ? 1u : 0u)));
    changed->again = !glove->begun || (end > &changed->rows[MOST_REPLACED]);
    changed->end = end;
}

/* Renew the sums of a part: add up all rows again, or replace those that have changed. */
static void renew(thenar_glove *glove, uint_fast16_t part, const changes *changed, largest *best)
{
    uint32_t *const sum = glove->sums[part];
    const change *each = changed->rows;
    uint32_t s0 = sum[0];
    uint32_t s1 = sum[1];

    if (changed->again) {
        ADD_AGAIN(glove->start[part]);
    }
    else {
        while (each != changed->end) {
            REPLACE(&each->before[part * ROWS * WORDS], &each->after[part * ROWS * WORDS]);
            each++;
        }
    }
    sum[0] = s0;
    sum[1] = s1;
    PREDICT(0u, best);
}

thenar_glove_class thenar_glove_update(thenar_glove *glove)
{
    largest best = {0u, 0u};
    changes changed;

    if (glove->missing) {
        leave_out(glove);
    }
    find_changes(glove, &changed);
    glove->begun = true;
    for (uint_fast16_t part = 0u; part < PARTS; part++) {
        renew(glove, part, &changed, &best);
    }
    return (thenar_glove_class)best.grasp;
}

/* Add steps to the initial score of a class. */
static void shift_start(thenar_glove *glove, uint16_t k, uint16_t steps)
{
    for (uint16_t part = 0u; part < PARTS; part++) {
        const uint16_t at = k;

        if (at < 3u) {
            const uint16_t lane = (uint16_t)(at / 2u);
            const uint16_t shift = (uint16_t)(16u * (at % 2u));

            glove->start[part][lane] += (uint32_t)(int32_t)(int16_t)steps << shift;
        }
    }
}
#endif

/* Add the mean of a missing input to the initial scores, or subtract it again. */
static void replace_by_mean(thenar_glove *glove, uint16_t input, bool lost)
{
    for (uint16_t k = 0u; k < CLASSES; k++) {
        const thenar_glove_mean mean = (thenar_glove_mean)READ_WORD(thenar_glove_means[input][k]);
        const uint16_t steps = (uint16_t)(int16_t)mean;

        shift_start(glove, k, (uint16_t)(lost ? steps : (0u - steps)));
    }
    glove->n_lost = (uint16_t)(lost ? (glove->n_lost + 1u) : (glove->n_lost - 1u));
    glove->missing = glove->n_lost > 0u;
    glove->begun = false;
}

void thenar_glove_lose_switch(thenar_glove *glove, thenar_glove_switch number, bool lost)
{
    if (number < THENAR_GLOVE_SWITCHES) {
        uint8_t *const port = &glove->lost_switches[READ_BYTE(thenar_glove_places[number].port)];
        const uint8_t bit = READ_BYTE(thenar_glove_places[number].bit);

        if (((*port & bit) != 0u) != lost) {
            *port ^= bit;
            replace_by_mean(glove, number, lost);
        }
    }
}

void thenar_glove_lose_joint(thenar_glove *glove, uint16_t number, bool lost)
{
    if (number < THENAR_GLOVE_JOINTS) {
        uint8_t *const eight = &glove->lost_joints[number / 8u];
        const uint8_t bit = (uint8_t)(1u << (number % 8u));

        if (((*eight & bit) != 0u) != lost) {
            *eight ^= bit;
            replace_by_mean(glove, (uint16_t)(6u + number), lost);
        }
    }
}

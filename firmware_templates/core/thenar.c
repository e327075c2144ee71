/* SPDX-License-Identifier: MIT */
/*
 * thenar.c: the classifier; thenar.h describes its use.
 *
 * A frame is recognised in three steps: find the row that each input adds, add the rows up, compare the sums. Every row
 * has one entry for each grasp type.
 */
#include "thenar_block.h"

static bool bit_of(const uint8_t *bytes, uint16_t number)
{
    return (((unsigned)bytes[number / 8u] >> (number % 8u)) & 1u) != 0u;
}

static void set_bit(uint8_t *bytes, uint16_t number, bool value)
{
    /* 1 << (number % 8), which an AVR would shift in as many steps. */
    uint8_t bit = ((number & 1u) != 0u) ? 2u : 1u;

    bit = (uint8_t)(bit * (((number & 2u) != 0u) ? 4u : 1u) * (((number & 4u) != 0u) ? 16u : 1u));
    bytes[number / 8u] = (uint8_t)(value ? (bytes[number / 8u] | bit) : (bytes[number / 8u] & (uint8_t)~bit));
}

/* The inputs come first, as a frame: switches in whole words, then codes. */
void thenar_init(thenar *hand, const thenar_model *model, uint16_t *memory)
{
    const uint16_t bytes = (uint16_t)((model->switches + model->joints + 7u) / 8u);

    hand->model = model;
    hand->switches = (uint8_t *)memory;
    hand->codes = memory + ((model->switches + 15u) / 16u);
    hand->scores = (int16_t *)(hand->codes + model->joints);
    hand->found = (uint16_t *)hand->scores + (2u * model->row_pairs);
    hand->distances = (uint8_t *)(hand->found + model->found);
    hand->lost = hand->distances + model->n_lines;
    hand->n_lost = 0u;
    for (uint8_t *byte = hand->switches; byte < (hand->lost + bytes); byte++) {
        *byte = 0u;
    }
}

void thenar_set_switch(thenar *hand, uint16_t number, bool closed)
{
    if ((number < hand->model->switches) && ((hand->n_lost == 0u) || !bit_of(hand->lost, number))) {
        set_bit(hand->switches, number, closed);
    }
}

/* Called last, so that setting a code saves no registers. */
static void clear_lost_code(thenar *hand, uint16_t joint)
{
    if (bit_of(hand->lost, (uint16_t)(hand->model->switches + joint))) {
        hand->codes[joint] = 0u;
    }
}

void thenar_set_code(thenar *hand, uint16_t joint, uint16_t code)
{
    if (joint < hand->model->joints) {
        hand->codes[joint] = code;
        if (hand->n_lost > 0u) {
            clear_lost_code(hand, joint);
        }
    }
}

static void lose(thenar *hand, uint16_t input, bool lost)
{
    if (bit_of(hand->lost, input) != lost) {
        set_bit(hand->lost, input, lost);
        hand->n_lost = (uint16_t)(lost ? (hand->n_lost + 1u) : (hand->n_lost - 1u));
    }
}

void thenar_lose_switch(thenar *hand, uint16_t number, bool lost)
{
    if (number < hand->model->switches) {
        thenar_set_switch(hand, number, false);
        lose(hand, number, lost);
    }
}

void thenar_lose_joint(thenar *hand, uint16_t joint, bool lost)
{
    if (joint < hand->model->joints) {
        lose(hand, (uint16_t)(hand->model->switches + joint), lost);
        clear_lost_code(hand, joint);
    }
}

/* Return how many thresholds are below the joint's code, by halving. */
static inline unsigned bin_of(const thenar *hand, const thenar_bins *bins)
{
    const uint16_t code = hand->codes[THENAR_READ_16(&bins->joint)];
    const uint16_t *const thresholds = hand->model->thresholds + THENAR_READ_16(&bins->first_threshold);
    unsigned below = 0u;

    for (unsigned half = THENAR_READ_16(&bins->half); half > 0u; half /= 2u) {
        if (THENAR_READ_16(&thresholds[below + half - 1u]) < code) {
            below += half;
        }
    }
    return below;
}

/* Switches: a group adds one row, the sum of the rows of its closed switches; with all open it adds none. */
static uint16_t *find_switches(const thenar *hand, uint16_t *found)
{
    const unsigned pairs = hand->model->row_pairs;
    const uint8_t group = hand->model->group;
    const uint8_t mask = (uint8_t)((1u << group) - 1u);
    const unsigned per_group = pairs * mask;
    const uint8_t *const end = hand->switches + ((hand->model->switches + 7u) / 8u);
    unsigned first = 0u; /* the row before those of the first group of a byte */

    for (const uint8_t *byte = hand->switches; byte < end; byte++) {
        unsigned before = first;

        for (uint_fast8_t closed = *byte; closed != 0u; closed = (uint_fast8_t)(closed >> group)) {
            if ((closed & mask) != 0u) {
                *found = (uint16_t)(before + ((closed & mask) * pairs));
                found++;
            }
            before += per_group;
        }
        first += per_group * hand->model->groups_of_byte;
    }
    return found;
}

/* Joints: the row of the bin of each, and the row of the cell of each pair. */
static uint16_t *find_bins(const thenar *hand, uint16_t *found)
{
    const unsigned pairs = hand->model->row_pairs;
    const thenar_bins *bins = hand->model->bins;
    const thenar_grid *grid = hand->model->grids;

    for (unsigned left = hand->model->n_bins; left > 0u; left--) {
        *found = (uint16_t)(THENAR_READ_16(&bins->first_row) + (bin_of(hand, bins) * pairs));
        found++;
        bins++;
    }
    for (unsigned left = hand->model->n_grids; left > 0u; left--) {
        const unsigned before = bin_of(hand, &grid->down) * THENAR_READ_16(&grid->width);

        *found = (uint16_t)(THENAR_READ_16(&grid->down.first_row) + ((before + bin_of(hand, &grid->across)) * pairs));
        found++;
        grid++;
    }
    return found;
}

/* Lines: the distance of the code of each joint. */
static void find_distances(const thenar *hand)
{
    const uint16_t *const codes = hand->codes;
    const thenar_line *line = hand->model->lines;
    uint8_t *distance = hand->distances;

    for (const uint8_t *const end = &distance[hand->model->n_lines]; distance < end; distance++) {
        const unsigned code = codes[THENAR_READ_16(&line->joint)];
        const unsigned low = THENAR_READ_16(&line->low);
        const unsigned span = THENAR_READ_16(&line->span);
        const unsigned above = (code > low) ? (code - low) : 0u;
        const unsigned clipped = (above < span) ? above : span;

        *distance = (uint8_t)((clipped << THENAR_READ_8(&line->left)) >> THENAR_READ_8(&line->right));
        line++;
    }
}

/* Add up the rows from hand->found to `end`, and the lines, eight grasp types at a time. The last eight may overlap
   those before, so that rows need no padding. */
static void add(thenar *hand, const uint16_t *end)
{
    const uint16_t pairs = hand->model->row_pairs;
    const thenar_slopes *const slopes = hand->model->slopes;
    const uint8_t *const last = hand->distances + hand->model->n_lines;

    for (uint16_t next = 0u; next < pairs; next = (uint16_t)(next + 4u)) {
        const uint16_t first = ((next + 4u) <= pairs) ? next : (uint16_t)(pairs - 4u);
        const thenar_pair *const rows = hand->model->rows + (first * THENAR_ENTRIES);
        unsigned at = first * THENAR_ENTRIES;
        block sums = {0u};

        for (const uint16_t *found = hand->found; found < end; found++) {
            add_row(&sums, rows + (*found * THENAR_ENTRIES));
        }
        for (const uint8_t *distance = hand->distances; distance < last; distance++) {
            add_line(&sums, *distance, &slopes[at]);
            at += pairs * THENAR_ENTRIES;
        }
        put(&hand->scores[2u * first], &sums);
    }
}

/* Missing inputs were added as open, or as code 0: add the difference to their means. */
static void add_means(thenar *hand)
{
    const int8_t *mean = hand->model->means;

    for (uint16_t input = 0u; input < (hand->model->switches + hand->model->joints); input++) {
        const bool lost = bit_of(hand->lost, input);
        const uint8_t shift = (uint8_t)THENAR_READ_8(mean);

        for (uint16_t k = 0u; lost && (k < hand->model->classes); k++) {
            hand->scores[k] = (int16_t)(uint16_t)((uint16_t)hand->scores[k]
                + ((uint16_t)(int8_t)THENAR_READ_8(&mean[k + 1u]) << shift));
        }
        mean += hand->model->classes + 1u;
    }
}

void thenar_sum(thenar *hand)
{
    find_distances(hand);
    hand->found[0] = 0u; /* the start */
    add(hand, find_bins(hand, find_switches(hand, &hand->found[1])));
}

uint16_t thenar_classify(thenar *hand)
{
    const int16_t *const scores = hand->scores;
    unsigned best = 0u;

    hand->model->sum(hand);
    if (hand->n_lost > 0u) {
        add_means(hand);
    }
    int16_t top = scores[0];
    for (unsigned k = 1u, classes = hand->model->classes; k < classes; k++) {
        const int16_t score = scores[k];

        if (score > top) {
            top = score;
            best = k;
        }
    }
    return (uint16_t)best;
}

static bool is_outside(const thenar *hand, const thenar_rejection *rejection, uint16_t grasp)
{
    const uint16_t joints = hand->model->joints;
    const uint16_t *range = rejection->ranges + ((size_t)grasp * joints * 2u);
    uint16_t outside = 0u;

    for (uint16_t joint = 0u; joint < joints; joint++) {
        const uint16_t code = hand->codes[joint];
        const bool beyond = (code < THENAR_READ_16(&range[0])) || (code > THENAR_READ_16(&range[1]));

        if (beyond && !bit_of(hand->lost, (uint16_t)(hand->model->switches + joint))) {
            outside++;
        }
        range += 2;
    }
    return outside > rejection->outside;
}

uint16_t thenar_decide(const thenar *hand, uint16_t grasp)
{
    const thenar_model *const model = hand->model;
    const thenar_rejection *const rejection = model->rejection;
    uint16_t closed = 0u, missing = 0u;

    if ((rejection == NULL) || (grasp >= model->classes)) {
        return grasp;
    }
    for (uint16_t number = 0u; number < model->switches; number++) {
        closed = (uint16_t)(closed + (bit_of(hand->switches, number) ? 1u : 0u));
        missing = (uint16_t)(missing + (bit_of(hand->lost, number) ? 1u : 0u));
    }
    bool refused = ((closed + missing) < THENAR_READ_16(&rejection->closed[2u * grasp]))
        || (closed > THENAR_READ_16(&rejection->closed[(2u * grasp) + 1u])) || is_outside(hand, rejection, grasp);
    if (hand->n_lost == 0u) {
        refused = refused || (hand->scores[grasp] < (int16_t)THENAR_READ_16(&rejection->least_scores[grasp]));
    }
    return refused ? model->none : grasp;
}

uint16_t thenar_margin(const thenar *hand)
{
    int16_t best = hand->scores[0], second = INT16_MIN;

    for (uint16_t k = 1u; k < hand->model->classes; k++) {
        const int16_t score = hand->scores[k];

        second = (score > best) ? best : ((score > second) ? score : second);
        best = (score > best) ? score : best;
    }
    return (uint16_t)((uint16_t)best - (uint16_t)second);
}

/* 2 to the power of 15 - i / 64. */
static const uint16_t powers[65] THENAR_FLASH = {
    32768, 32415, 32066, 31720, 31379, 31041, 30706, 30376, 30048, 29725, 29405, 29088, 28774,
    28464, 28158, 27855, 27554, 27258, 26964, 26674, 26386, 26102, 25821, 25543, 25268, 24995,
    24726, 24460, 24196, 23936, 23678, 23423, 23170, 22921, 22674, 22430, 22188, 21949, 21713,
    21479, 21247, 21019, 20792, 20568, 20347, 20127, 19911, 19696, 19484, 19274, 19066, 18861,
    18658, 18457, 18258, 18061, 17867, 17674, 17484, 17296, 17109, 16925, 16743, 16562, 16384,
};

uint16_t thenar_probability(const thenar *hand, uint16_t grasp)
{
    const thenar_model *const model = hand->model;
    int16_t best = hand->scores[0];
    uint32_t one = 0u, all = 0u;

    for (uint16_t k = 1u; k < model->classes; k++) {
        best = (hand->scores[k] > best) ? hand->scores[k] : best;
    }
    for (uint16_t k = 0u; k < model->classes; k++) {
        /* The lag, in 64ths of a halving of the probability, and the rest in 256ths of such a step. */
        const uint16_t behind = (uint16_t)((uint16_t)best - (uint16_t)hand->scores[k]);
        const uint32_t steps = (uint32_t)behind * model->step;
        const uint32_t halves = steps >> (model->shift + 6u);

        if (halves < 16u) {
            const uint8_t at = (uint8_t)((steps >> model->shift) & 63u);
            const uint32_t above = THENAR_READ_16(&powers[at]);
            const uint32_t below = THENAR_READ_16(&powers[at + 1u]);
            const uint32_t between = (steps >> (model->shift - 8u)) & 255u;
            const uint32_t power = (above - (((above - below) * between) >> 8)) >> halves;

            all += power;
            one = (k == grasp) ? power : one;
        }
    }
    return (uint16_t)(((one * 65535u) + (all / 2u)) / all);
}

uint16_t thenar_name(const thenar_model *model, uint16_t grasp, char *text, uint16_t size)
{
    const char *from = model->names;
    uint16_t length = 0u;

    for (uint16_t before = (grasp < model->n_names) ? grasp : 0u; before > 0u; from++) {
        before = (uint16_t)(before - ((THENAR_READ_8(from) == 0) ? 1u : 0u));
    }
    while ((grasp < model->n_names) && (THENAR_READ_8(&from[length]) != 0)) {
        if ((length + 1u) < size) {
            text[length] = (char)THENAR_READ_8(&from[length]);
        }
        length++;
    }
    if (size > 0u) {
        text[(length < size) ? length : (uint16_t)(size - 1u)] = '\0';
    }
    return length;
}

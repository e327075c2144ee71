/* SPDX-License-Identifier: MIT */
/*
 * thenar_segments.c: the cheapest segmentation of a stream, tick by tick; thenar_segments.h describes its use.
 *
 * Costs are kept modulo 2^16: no two that are compared differ by more than 32767. For each state, `sum` is its total
 * cost of all ticks, and `best` the least cost of a path to the beginning of its segment, less the sum at that tick.
 */
#include "thenar_segments.h"

#define LESS(one, other) ((int16_t)(uint16_t)((one) - (other)) < 0)

void thenar_segment_start(thenar_segmenter *stream, const thenar_segment_model *model, uint16_t *memory)
{
    const uint16_t masks = (uint16_t)((model->n_states + 7u) / 8u);
    const thenar_segmenter fresh = {.model = model, .newest = (uint8_t)(model->n_states - 1u)};

    *stream = fresh;
    stream->paths = (thenar_segment_path *)memory;
    stream->ticks = (thenar_segment_tick *)(stream->paths + model->n_states);
    stream->at = (uint16_t *)(stream->ticks + model->lag);
    stream->waiting = stream->at + model->n_rings;
    stream->begun = (uint8_t *)(stream->waiting + model->waiting);
    for (uint8_t *byte = (uint8_t *)memory; byte < (stream->begun + (2u * masks * model->lag)); byte++) {
        *byte = 0u;
    }
    /* More expensive than any continuation: nothing ends before the first tick. */
    stream->first = 0x4000u;
    stream->none = 0x4000u;
    stream->ending = 0x4000u;
    for (uint8_t ring = 0u; ring < model->n_rings; ring++) {
        stream->at[ring] = THENAR_READ_16(&model->rings[ring].begin);
    }
}

/* The record of the state's bit: whether it begins in a tick, for all ticks twice, so that the last `lag` are
   contiguous. Eight states share it. */
static uint8_t *begun_of(const thenar_segmenter *stream, uint8_t state)
{
    return stream->begun + (2u * (state / 8u) * stream->model->lag);
}

static void mark(const thenar_segmenter *stream, uint8_t *begun, uint8_t bits)
{
    begun[stream->row] = bits;
    begun[stream->row + stream->model->lag] = bits;
}

static uint16_t frame_cost(const thenar_segment_model *model, uint16_t top, int16_t score)
{
    const uint16_t behind = (uint16_t)(top - (uint16_t)score);

    /* Below the limit there is no overflow. */
    return (behind >= model->limit) ? model->most : (uint16_t)((uint16_t)((behind >> model->shift) * model->gain) >> 8);
}

/* Take a tick that costs state k `cost`, in which a segment of it could begin at `entered`, and record whether it does;
   return the cost at its end. */
static uint16_t take(const thenar_segmenter *stream, uint8_t k, uint16_t entered, uint16_t cost)
{
    const thenar_segment_state *const state = &stream->model->states[k];
    thenar_segment_path *const path = &stream->paths[k];
    const uint16_t began = (uint16_t)(entered - path->sum);
    const uint16_t sum = (uint16_t)(path->sum + cost + THENAR_READ_16(&state->stay));
    uint16_t mature;

    if (LESS(began, path->best)) {
        uint8_t *const begun = begun_of(stream, k);

        path->best = began;
        mark(stream, begun, (uint8_t)(begun[stream->row] | (1u << (k % 8u))));
    }
    path->sum = sum;
    mature = path->best;
    if (THENAR_READ_8(&state->least) > 1u) {
        const uint16_t row = stream->at[THENAR_READ_8(&state->ring)];
        uint16_t *const waits = &stream->waiting[row + THENAR_READ_8(&state->place)];
        const uint16_t waited = *waits;

        *waits = mature;
        mature = waited;
    }
    return (uint16_t)(mature + sum);
}

static void turn_rings(const thenar_segmenter *stream)
{
    const thenar_segment_ring *ring = stream->model->rings;

    for (uint8_t number = 0u; number < stream->model->n_rings; number++) {
        const uint16_t next = (uint16_t)(stream->at[number] + THENAR_READ_16(&ring->width));

        stream->at[number] = (next == THENAR_READ_16(&ring->end)) ? THENAR_READ_16(&ring->begin) : next;
        ring++;
    }
}

static void advance(thenar_segmenter *stream, const int16_t *scores, uint16_t top, uint16_t none_cost)
{
    const thenar_segment_model *const model = stream->model;
    const thenar_segment_state *state = model->states;
    const uint8_t types = (uint8_t)(model->n_states - 1u);
    uint16_t first = 0u, ending = 0u, least = 0u;

    for (uint8_t eight = 0u; eight < ((model->n_states + 7u) / 8u); eight++) {
        mark(stream, stream->begun + (2u * eight * model->lag), 0u);
    }
    for (uint8_t k = 0u; k < types; k++) {
        const uint16_t after_none = (uint16_t)(stream->none + THENAR_READ_16(&state->enter));
        const uint16_t after_type = (uint16_t)(stream->first + THENAR_READ_16(&state->direct));
        const uint16_t entered = LESS(after_none, after_type) ? after_none : after_type;
        const uint16_t mature = take(stream, k, entered, frame_cost(model, top, scores[k]));
        const uint16_t end = (uint16_t)(mature + THENAR_READ_16(&state->leave));
        const uint16_t total = (uint16_t)(stream->paths[k].best + stream->paths[k].sum);

        if ((k == 0u) || LESS(total, least)) {
            least = total;
            stream->newest = k;
        }
        if ((k == 0u) || LESS(mature, first)) {
            first = mature;
            stream->first_of = k;
        }
        if ((k == 0u) || LESS(end, ending)) {
            ending = end;
            stream->ending_of = k;
        }
        state++;
    }
    none_cost = model->scored ? frame_cost(model, top, scores[types]) : none_cost;
    stream->none = take(stream, types, stream->ending, none_cost);
    if (LESS(stream->paths[types].best + stream->paths[types].sum, least)) {
        stream->newest = types;
    }
    stream->first = first;
    stream->ending = ending;
    turn_rings(stream);
}

/* Return the place of the record from some ticks ago, fewer than `lag`. */
static uint8_t row_before(const thenar_segmenter *stream, uint8_t row, uint8_t ticks)
{
    return (uint8_t)((row < ticks) ? (row + stream->model->lag - ticks) : (row - ticks));
}

/* Return the state `lag` ticks ago on the cheapest path to the newest tick. */
static uint8_t state_before(thenar_segmenter *stream)
{
    const thenar_segment_model *const model = stream->model;
    const uint8_t none = (uint8_t)(model->n_states - 1u);
    uint8_t state = stream->newest, row = stream->row, left = model->lag;

    stream->same = true;
    for (;;) {
        const uint8_t *begun = begun_of(stream, state) + row + model->lag + 1u;
        const uint8_t bit = (uint8_t)(1u << (state % 8u));
        const uint8_t before = left;
        uint8_t back;

        while ((*--begun & bit) == 0u) {
            if (--left == 0u) {
                return state;
            }
        }
        stream->same = false;
        row = row_before(stream, row, (uint8_t)(before - left));
        if (state == none) {
            state = stream->ticks[row].ending_of;
        } else {
            const thenar_segment_state *const type = &model->states[state];
            const int16_t gap = (int16_t)(THENAR_READ_16(&type->direct) - THENAR_READ_16(&type->enter));

            state = (stream->ticks[row].ahead < gap) ? none : stream->ticks[row].first_of;
        }
        back = THENAR_READ_8(&model->states[state].least);
        if (back >= left) {
            return state;
        }
        left = (uint8_t)(left - back);
        row = row_before(stream, row, back);
    }
}

uint8_t thenar_segment_push(thenar_segmenter *stream, const int16_t *scores, uint16_t grasp, bool refused)
{
    const thenar_segment_model *const model = stream->model;
    const uint8_t row = (uint8_t)(((stream->row + 1u) == model->lag) ? 0u : (stream->row + 1u));
    thenar_segment_tick *const tick = &stream->ticks[row];
    uint8_t state = (uint8_t)(model->n_states - 1u);

    stream->row = row;
    tick->ahead = (int16_t)(uint16_t)(stream->none - stream->first);
    tick->first_of = stream->first_of;
    tick->ending_of = model->one_leave ? stream->first_of : stream->ending_of;
    /* All types cost more where a frame is rejected, so none costs less by that. */
    advance(stream, scores, (uint16_t)scores[grasp], (uint16_t)(refused ? (0u - model->refusal) : model->refusal));
    if (stream->known < model->lag) {
        stream->known++;
    } else {
        state = state_before(stream);
    }
    return state;
}

/* SPDX-License-Identifier: MIT */
/**
 * @file thenar_segments.h
 * @brief Segments of a stream of frames: nothing held, or a grasp from its beginning to its end.
 *
 *     static uint16_t memory[THENAR_GLOVE_SEGMENT_MEMORY];
 *     static thenar_segmenter stream;
 *
 *     thenar_segment_start(&stream, &thenar_glove_segment_model, memory);
 *     // every THENAR_GLOVE_TICK_US microseconds
 *     grasp = thenar_classify(&hand);
 *     state = thenar_segment_push(&stream, hand.scores, grasp, thenar_decide(&hand, grasp) != grasp);
 *
 * The costs of a build are in its thenar_NAME_segments.h and .c.
 */
#ifndef THENAR_SEGMENTS_H
#define THENAR_SEGMENTS_H

#include "thenar.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The costs of a segment of a state: after none, after another type, of its end, and of each tick; its shortest
 *  duration in ticks; and where it waits for as long: a ring, and a place in a row of it. */
typedef struct {
    uint16_t enter;
    uint16_t direct;
    uint16_t leave;
    uint16_t stay;
    uint8_t least;
    uint8_t ring;
    uint8_t place;
} thenar_segment_state;

/** The rows in which states with the same shortest duration wait. */
typedef struct {
    uint16_t begin;
    uint16_t end;
    uint16_t width;
} thenar_segment_ring;

/** The costs of a build. The last state is "none"; the others are the grasp types, by their numbers. */
typedef struct {
    uint8_t n_states;
    uint8_t n_rings;
    uint8_t lag;       /* ticks until a tick's state is known, at most 250 */
    uint8_t shift;     /* a frame costs its lag behind the best score, shifted, times gain / 256, */
    uint16_t gain;
    uint16_t limit;    /* or from this lag on */
    uint16_t most;     /* so much */
    uint16_t waiting;  /* places of all rings */
    uint16_t refusal;  /* the cost of none in a frame that is not rejected, subtracted in one that is */
    bool scored;       /* none has a score, and no refusal */
    bool one_leave;    /* every type's end costs the same */
    const thenar_segment_state *states; /* in flash */
    const thenar_segment_ring *rings;   /* in flash */
} thenar_segment_model;

/** What a segment that begins in a tick can follow; private. */
typedef struct {
    int16_t ahead;
    uint8_t first_of;
    uint8_t ending_of;
} thenar_segment_tick;

/** The costs of paths to a state: of all its ticks, and the least at the beginning of its segment; private. */
typedef struct {
    uint16_t sum;
    uint16_t best;
} thenar_segment_path;

/** A stream. The program reads `newest`, the state of the newest tick, and `same`; all other members are private. */
typedef struct {
    const thenar_segment_model *model;
    thenar_segment_path *paths;
    thenar_segment_tick *ticks;
    uint16_t *at;
    uint16_t *waiting;
    uint8_t *begun;
    uint16_t first;
    uint16_t none;
    uint16_t ending;
    uint8_t first_of;
    uint8_t ending_of;
    uint8_t newest;
    uint8_t row;
    uint8_t known;
    bool same; /**< The newest segment is that of the state that was returned last. */
} thenar_segmenter;

/** Initialise a stream; `memory` has as many words as the model's header says. */
void thenar_segment_start(thenar_segmenter *stream, const thenar_segment_model *model, uint16_t *memory);

/**
 * Take the next tick.
 *
 * @param scores   of the tick, from classify()
 * @param grasp    what classify() returned
 * @param refused  whether decide() rejects it
 *
 * @return the state `lag` ticks ago, the same as in Python; before the first tick, nothing is held
 */
uint8_t thenar_segment_push(thenar_segmenter *stream, const int16_t *scores, uint16_t grasp, bool refused);

#ifdef __cplusplus
}
#endif

#endif

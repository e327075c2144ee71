/* Frames, and Python's predictions for them: thenar_glove_check() compares the compiled classifier with these. */
#ifndef THENAR_GLOVE_CHECK_H
#define THENAR_GLOVE_CHECK_H

#include "thenar_glove.h"

#define THENAR_GLOVE_CHECKS 18u

static const struct {
    uint8_t closed[1]; /* bit b of byte i says whether switch 8 i + b is */
    uint16_t codes[THENAR_GLOVE_JOINTS];
    uint16_t grasp;
    int16_t scores[3];
} thenar_glove_checks[THENAR_GLOVE_CHECKS] = {
    { /* every switch open, lowest codes */
        {
            0x00
        },
        {
            0, 0
        },
        2,
        {
            -390, 180, 317
        },
    },
    { /* every switch closed, highest codes */
        {
            0x3f
        },
        {
            255, 255
        },
        0,
        {
            1682, -545, -166
        },
    },
    { /* drawn */
        {
            0x2a
        },
        {
            0, 200
        },
        2,
        {
            117, 222, 406
        },
    },
    { /* drawn */
        {
            0x3f
        },
        {
            60, 0
        },
        0,
        {
            592, -65, 444
        },
    },
    { /* drawn */
        {
            0x04
        },
        {
            0, 0
        },
        2,
        {
            -300, 168, 310
        },
    },
    { /* drawn */
        {
            0x01
        },
        {
            60, 91
        },
        1,
        {
            245, 475, -8
        },
    },
    { /* drawn */
        {
            0x0a
        },
        {
            60, 200
        },
        1,
        {
            40, 230, 146
        },
    },
    { /* drawn */
        {
            0x31
        },
        {
            62, 90
        },
        0,
        {
            607, -173, 317
        },
    },
    { /* drawn */
        {
            0x3a
        },
        {
            141, 200
        },
        0,
        {
            967, -518, 136
        },
    },
    { /* drawn */
        {
            0x16
        },
        {
            141, 200
        },
        0,
        {
            830, -222, -172
        },
    },
    { /* drawn */
        {
            0x06
        },
        {
            255, 0
        },
        2,
        {
            105, 78, 193
        },
    },
    { /* drawn */
        {
            0x20
        },
        {
            140, 0
        },
        2,
        {
            -103, 12, 517
        },
    },
    { /* drawn */
        {
            0x0f
        },
        {
            60, 200
        },
        0,
        {
            440, 423, 59
        },
    },
    { /* drawn */
        {
            0x3f
        },
        {
            61, 91
        },
        0,
        {
            1027, -55, 189
        },
    },
    { /* drawn */
        {
            0x1f
        },
        {
            62, 200
        },
        0,
        {
            1050, -127, -121
        },
    },
    { /* drawn */
        {
            0x39
        },
        {
            255, 90
        },
        0,
        {
            997, -663, 268
        },
    },
    { /* drawn */
        {
            0x16
        },
        {
            61, 90
        },
        2,
        {
            165, -42, 213
        },
    },
    { /* drawn */
        {
            0x18
        },
        {
            0, 91
        },
        0,
        {
            485, -420, -7
        },
    },
};

static bool thenar_glove_agrees(thenar *hand, unsigned check)
{
    bool same;

    for (unsigned number = 0u; number < 6u; ++number) {
        const unsigned eight = thenar_glove_checks[check].closed[number / 8u];

        thenar_set_switch(hand, (uint16_t)number, ((eight >> (number % 8u)) & 1u) != 0u);
    }
    for (unsigned joint = 0u; joint < 2u; ++joint) {
        thenar_set_code(hand, (uint16_t)joint, thenar_glove_checks[check].codes[joint]);
    }
    same = thenar_classify(hand) == thenar_glove_checks[check].grasp;
    for (unsigned k = 0u; k < 3u; ++k) {
        same = same && (hand->scores[k] == thenar_glove_checks[check].scores[k]);
    }
    return same;
}

/* Return the number of frames whose prediction differs from Python's. */
static unsigned thenar_glove_check(void)
{
    static uint16_t memory[THENAR_GLOVE_MEMORY];
    static thenar hand;
    unsigned wrong = 0u;

    thenar_init(&hand, &thenar_glove_model, memory);
    for (unsigned check = 0u; check < THENAR_GLOVE_CHECKS; ++check) {
        wrong += thenar_glove_agrees(&hand, check) ? 0u : 1u;
    }
    return wrong;
}

#endif

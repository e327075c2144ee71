/* Frames, and Python's predictions for them: thenar_glove_check() compares the compiled classifier with these. */
#ifndef THENAR_GLOVE_CHECK_H
#define THENAR_GLOVE_CHECK_H

#include "thenar_glove.h"

#define THENAR_GLOVE_CHECKS 18u

static const struct {
    uint8_t closed[1]; /* bit b of byte i says whether switch 8 i + b is */
    thenar_glove_code codes[THENAR_GLOVE_JOINTS];
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

static const char *const thenar_glove_grasps[3] = {
    "power grip",
    "tip pinch",
    "lateral pinch",
};

/* Fill in the input. */
static void thenar_glove_take(thenar_glove *glove, unsigned check)
{
    for (unsigned number = 0u; number < 6u; ++number) {
        const unsigned eight = thenar_glove_checks[check].closed[number / 8u];

        thenar_glove_set_switch(glove, (thenar_glove_switch)number, ((eight >> (number % 8u)) & 1u) != 0u);
    }
    for (unsigned joint = 0u; joint < 2u; ++joint) {
        glove->input.codes[joint] = thenar_glove_checks[check].codes[joint];
    }
}

static bool thenar_glove_same(const char *one, const char *other)
{
    unsigned at = 0u;

    while ((one[at] != '\0') && (one[at] == other[at])) {
        at++;
    }
    return one[at] == other[at];
}

static bool thenar_glove_agrees(const thenar_glove *glove, unsigned check, uint16_t grasp)
{
    bool same = grasp == thenar_glove_checks[check].grasp;

    for (unsigned k = 0u; k < 3u; ++k) {
        same = same && (glove->scores[k] == thenar_glove_checks[check].scores[k]);
    }
    return same;
}

/* Return the number of frames whose prediction differs from Python's, by update() or by classify(), plus the number of
   grasp types with another name. */
static unsigned thenar_glove_check(void)
{
    static thenar_glove glove;
    unsigned wrong = 0u;

    thenar_glove_init(&glove);
    for (unsigned check = 0u; check < THENAR_GLOVE_CHECKS; ++check) {
        thenar_glove_take(&glove, check);
        const bool updated = thenar_glove_agrees(&glove, check, thenar_glove_update(&glove));

        if (!updated || !thenar_glove_agrees(&glove, check, thenar_glove_classify(&glove))) {
            wrong++;
        }
    }
    for (unsigned k = 0u; k < 3u; ++k) {
        if (!thenar_glove_same(thenar_glove_grasp((thenar_glove_class)k), thenar_glove_grasps[k])) {
            wrong++;
        }
    }
    return wrong;
}

#endif

/* thenar_glove.h: recognises 3 grasp types from 6 switches and 2 joints of a glove.
   Layout for cortex-m0plus: 16-bit entries, up to 6 switches a look-up, codes looked up in 256 bytes a joint, up to
   2 joints a look-up: the fastest of 54 layouts in 65536 bytes of flash, about 106 instructions (156 by update())
   and 2171 bytes.

   From the tables 0123456789abcdef; thenar 0.1.0, template classifier/thenar_NAME.h.j2. */
#ifndef THENAR_GLOVE_H
#define THENAR_GLOVE_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define THENAR_GLOVE_CLASSES 3u
#define THENAR_GLOVE_SWITCHES 6u
#define THENAR_GLOVE_PORTS 1u
#define THENAR_GLOVE_JOINTS 2u

/* Number of a grasp type, of a switch; a joint's code, in the units of the recordings. */
typedef uint8_t thenar_glove_class;
typedef uint8_t thenar_glove_switch;
typedef uint8_t thenar_glove_code; /* of codes above 255: 255 */

/* What is classified: the bytes of ports as they come. Bit b of switches[p] is 1 while the switch in place b is
   closed; bits without a switch mean nothing.
     switches[0]: thumb tip, index tip, index middle, middle tip, palm radial, palm ulnar
     codes[0]: thumb_rotation, the glove's own codes
     codes[1]: index_pij, the glove's own codes
*/
typedef struct {
    uint8_t switches[THENAR_GLOVE_PORTS];
    thenar_glove_code codes[THENAR_GLOVE_JOINTS];
} thenar_glove_frame;

/* Written by the caller before classify() or update(), which alone read it. */
extern thenar_glove_frame thenar_glove_input;

/* The scores of what was classified last, equal to Python's; before, those of all switches open and all codes 0. */
extern int16_t thenar_glove_scores[THENAR_GLOVE_CLASSES];

/* Say in the input whether a switch is closed; numbers from THENAR_GLOVE_SWITCHES on are ignored. */
void thenar_glove_set_switch(thenar_glove_switch number, bool closed);

/* Say that an input cannot be read, or can be read again; numbers beyond the last are ignored. While it is missing the
   mean of its rows stands in for it, as in Python: classify() and update() open its switch, or make its code 0. */
void thenar_glove_lose_switch(thenar_glove_switch number, bool lost);
void thenar_glove_lose_joint(uint16_t number, bool lost);

/* Score the input, and return the first of the grasp types whose score is largest. */
thenar_glove_class thenar_glove_classify(void);

/* The same answer by what has changed since the last classify() or update(), either of which may come first. */
thenar_glove_class thenar_glove_update(void);

/* The name of a grasp type in UTF-8, "" for a number that is none. */
const char *thenar_glove_grasp(thenar_glove_class grasp);

#ifdef __cplusplus
}
#endif

#endif

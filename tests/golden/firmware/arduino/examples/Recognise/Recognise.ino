/* Recognises grasps and prints each new one at 115200 baud: switches on digital pins, joints on analog pins. */
#include <thenar_glove.h>

static thenar_glove glove;

#if NUM_DIGITAL_PINS - NUM_ANALOG_INPUTS < 8
#error "this board has too few pins for every switch: read a matrix or an expander in read_switches()"
#endif

/* The pin of each switch; closed, it connects the pin to ground. Change them to how the glove is wired. */
static const uint8_t switch_pins[] = {
    2, /* thumb tip */
    3, /* index tip */
    4, /* index middle */
    5, /* middle tip */
    6, /* palm radial */
    7, /* palm ulnar */
};

static void read_switches()
{
    for (uint8_t i = 0; i < sizeof switch_pins; ++i) {
        thenar_glove_set_switch(&glove, i, digitalRead(switch_pins[i]) == LOW);
    }
}

#if NUM_ANALOG_INPUTS < 2
#error "this board has too few analog inputs for every joint: read a multiplexer in read_joints()"
#endif

/* A joint's code, of what analogRead() gives. The build was made of the codes of its recordings and knows nothing of
   your sensors: the same posture must have the same code.
     0: thumb_rotation: the glove's own codes
     1: index_pij: the glove's own codes
*/
#ifndef CODE_OF
#error "say what the code of a joint is: #define CODE_OF(joint, reading), from the list above; a reading alone is none"
#endif

/* The pin of each joint. */
static const uint8_t joint_pins[] = {
    A0, /* thumb_rotation: the glove's own codes */
    A1, /* index_pij: the glove's own codes */
};

static void read_joints()
{
    for (uint8_t i = 0; i < sizeof joint_pins; ++i) {
        glove.input.codes[i] = (thenar_glove_code)CODE_OF(i, analogRead(joint_pins[i]));
    }
}

void setup()
{
    thenar_glove_init(&glove);
    Serial.begin(115200);
    for (uint8_t i = 0; i < sizeof switch_pins; ++i) {
        pinMode(switch_pins[i], INPUT_PULLUP);
    }
}

void loop()
{
    static int32_t shown = -1;

    read_switches();
    read_joints();

    const thenar_glove_class grasp = thenar_glove_update(&glove);
    if (grasp != shown) {
        shown = grasp;
        Serial.println((const __FlashStringHelper *)thenar_glove_grasp(grasp));
    }
    delay(10); /* contacts settle */
}

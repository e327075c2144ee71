/* Recognises grasps and prints each new one at 115200 baud: switches on digital pins, joints on analog pins. */
#include <thenar_glove.h>

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
        thenar_glove_set_switch(i, digitalRead(switch_pins[i]) == LOW);
    }
}

#if NUM_ANALOG_INPUTS < 2
#error "this board has too few analog inputs for every joint: read a multiplexer in read_joints()"
#endif

/* The pin of each joint. Its codes must be those of the recordings: the same sensor, the same code for a posture. */
static const uint8_t joint_pins[] = {
    A0, /* thumb_rotation */
    A1, /* index_pij */
};

static void read_joints()
{
    for (uint8_t i = 0; i < sizeof joint_pins; ++i) {
        thenar_glove_input.codes[i] = (uint8_t)(analogRead(joint_pins[i]) >> 2);
    }
}

void setup()
{
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

    const thenar_glove_class grasp = thenar_glove_update();
    if (grasp != shown) {
        shown = grasp;
        Serial.println((const __FlashStringHelper *)thenar_glove_grasp(grasp));
    }
    delay(10); /* contacts settle */
}

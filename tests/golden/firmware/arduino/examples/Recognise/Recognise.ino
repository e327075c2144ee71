/* Recognises grasps and prints each new one at 115200 baud: switches on digital pins, joints on analog pins. */
#include <thenar_glove.h>
#include <thenar_glove_codes.h>

static thenar_glove glove;
static thenar_glove_codes codes;

#define SENSORS 2

/* On a board with fewer analog inputs, multiplexers CD74HC4067 replace them, sixteen sensors each: the first one's
   output is on A0, the second's on A1; they share four address pins, S0 to S3. */
#if NUM_ANALOG_INPUTS < SENSORS && !defined(MULTIPLEXERS)
#define MULTIPLEXERS
#endif
#if defined(MULTIPLEXERS) && NUM_ANALOG_INPUTS < (SENSORS + 15) / 16
#error "this board has too few analog inputs, even for one to each multiplexer: read the sensors in reading_of()"
#endif

#ifdef PIN_A0
#define DIGITAL_PINS PIN_A0 /* those before the analog inputs */
#else
#define DIGITAL_PINS (NUM_DIGITAL_PINS - NUM_ANALOG_INPUTS)
#endif

/* On a board with fewer digital pins, shift registers 74HC165 replace them, eight switches each, with a resistor to the
   supply at every input: the first switch is on D7 of the chip next to the board, the eighth on D0, the ninth on D7 of
   the chip whose Q7 is connected to DS of the first. */
#ifdef MULTIPLEXERS
#define PINS_NEEDED 12
#else
#define PINS_NEEDED 8
#endif
#if DIGITAL_PINS < PINS_NEEDED && !defined(SHIFT_REGISTERS)
#define SHIFT_REGISTERS
#endif

typedef struct {
    thenar_glove_switch number;
    int16_t pin;
} wired_switch;

/* The pin of each switch; closed, it connects the pin to ground. Change them to the glove's wiring. */
static const wired_switch switches[] = {
    {0, 2}, /* thumb tip */
    {1, 3}, /* index tip */
    {2, 4}, /* index middle */
    {3, 5}, /* middle tip */
    {4, 6}, /* palm radial */
    {5, 7}, /* palm ulnar */
};
#define SWITCHES (sizeof switches / sizeof switches[0])

#ifdef SHIFT_REGISTERS
#define LOAD_PIN 2 /* PL of all */
#define CLOCK_PIN 3 /* CP of all */
#define DATA_PIN 4 /* Q7 of the first */

static void begin_switches()
{
    pinMode(LOAD_PIN, OUTPUT);
    pinMode(CLOCK_PIN, OUTPUT);
    pinMode(DATA_PIN, INPUT_PULLUP);
    digitalWrite(LOAD_PIN, HIGH);
    digitalWrite(CLOCK_PIN, LOW);
}

static void read_switches()
{
    digitalWrite(LOAD_PIN, LOW);
    digitalWrite(LOAD_PIN, HIGH);
    for (size_t i = 0; i < SWITCHES; ++i) {
        thenar_glove_set_switch(&glove, switches[i].number, digitalRead(DATA_PIN) == LOW);
        digitalWrite(CLOCK_PIN, HIGH);
        digitalWrite(CLOCK_PIN, LOW);
    }
}
#else
static void begin_switches()
{
    for (size_t i = 0; i < SWITCHES; ++i) {
        pinMode(switches[i].pin, INPUT_PULLUP);
    }
}

static void read_switches()
{
    for (size_t i = 0; i < SWITCHES; ++i) {
        thenar_glove_set_switch(&glove, switches[i].number, digitalRead(switches[i].pin) == LOW);
    }
}
#endif

#ifdef MULTIPLEXERS
#ifdef SHIFT_REGISTERS
static const uint8_t address_pins[] = {5, 6, 7, 8}; /* S0 to S3 */
#else
static const uint8_t address_pins[] = {8, 9, 10, 11}; /* S0 to S3 */
#endif
static const uint8_t output_pins[] = {A0};

static int reading_of(uint8_t sensor)
{
    for (uint8_t bit = 0; bit < 4; ++bit) {
        digitalWrite(address_pins[bit], (sensor >> bit & 1) != 0 ? HIGH : LOW);
    }
    delayMicroseconds(10); /* the channel settles */
    return analogRead(output_pins[sensor / 16]);
}
#else
/* The pin of each sensor. */
static const uint8_t sensor_pins[SENSORS] = {
    A0, /* thumb_rotation: code 1 and code 255 */
    A1, /* index_pij: code 1 and code 255 */
};

static int reading_of(uint8_t sensor)
{
    return analogRead(sensor_pins[sensor]);
}
#endif

/* The results of reading_of() for each sensor at its two points. */
static const int readings[SENSORS][2] = {
    {0, 0}, /* thumb_rotation: code 1 and code 255 */
    {0, 0}, /* index_pij: code 1 and code 255 */
};

#ifndef CALIBRATED
#define CALIBRATED 0 /* set to 1 once the readings are filled in */
#endif
#if !CALIBRATED && !defined(SHOW_READINGS)
#error "unknown readings: thenar firmware --glove, or SHOW_READINGS, fill in `readings`, set CALIBRATED: see README.md"
#endif

static void begin_sensors()
{
#ifdef MULTIPLEXERS
    for (uint8_t bit = 0; bit < 4; ++bit) {
        pinMode(address_pins[bit], OUTPUT);
    }
#endif
    thenar_glove_codes_init(&codes);
    for (uint8_t i = 0; i < SENSORS; ++i) {
        if (CALIBRATED && !thenar_glove_calibrate(&codes, i, readings[i][0], readings[i][1])) {
            Serial.print("the two readings make no line: sensor ");
            Serial.println(i);
        }
    }
}

static void read_sensors()
{
    for (uint8_t i = 0; i < SENSORS; ++i) {
        const int reading = reading_of(i);

        thenar_glove_set_reading(&glove, &codes, i, reading);
#ifdef SHOW_READINGS
        Serial.print(reading);
        Serial.print(i + 1 < SENSORS ? ',' : '\n');
#endif
    }
}

void setup()
{
    Serial.begin(115200);
    thenar_glove_init(&glove);
    begin_switches();
    begin_sensors();
}

void loop()
{
    static int32_t shown = -1;

    read_switches();
    read_sensors();

    const thenar_glove_class grasp = thenar_glove_update(&glove);
    if (grasp != shown) {
        shown = grasp;
        Serial.println((const __FlashStringHelper *)thenar_glove_grasp(grasp));
    }
    delay(10); /* contacts settle */
}

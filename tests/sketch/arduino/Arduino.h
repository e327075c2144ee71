/* What the sketches use of Arduino's API, on this machine: time, pins, converter, serial ports.

   The headers need no library of C++, so that compilers for other machines take them. Pins are wired as `bench.cpp` is
   told on its standard input. A pin reads low if closed switches lead from it to ground
   or to a pin that is driven low. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stddef.h>
#include <stdint.h>

#define LOW 0
#define HIGH 1
#define INPUT 0
#define OUTPUT 1
#define INPUT_PULLUP 2
#define SERIAL_8N1 0x800001c

unsigned long micros();
void delayMicroseconds(unsigned int us);
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t value);
int digitalRead(uint8_t pin);
void analogReadResolution(int bits);
int analogRead(uint8_t pin);

class SerialPort {
public:
    explicit SerialPort(const char *name) : name_(name) {}
    void begin(unsigned long baud, uint32_t config = SERIAL_8N1, int rx = -1, int tx = -1);
    size_t setTxBufferSize(size_t size) { return size; }
    size_t setRxBufferSize(size_t size) { return size; }
    bool setFIFOSize(size_t) { return true; }
    bool setRX(uint8_t) { return true; }
    bool setTX(uint8_t) { return true; }
    int availableForWrite();
    size_t write(const uint8_t *bytes, size_t size);
    int read();

private:
    const char *name_;
    int descriptor_ = -1;
};

extern SerialPort Serial, Serial1, Serial2;

/* Of the two cores. */
uint32_t esp_random();
struct Rp2040 {
    uint32_t hwrand32();
};
extern Rp2040 rp2040;

void setup();
void loop();

#endif

/* What the sketches use of Wire: the chips at it are those of tests/simavr/board_chips.c. */
#ifndef WIRE_H
#define WIRE_H

#include <stddef.h>
#include <stdint.h>

class TwoWire {
public:
    bool begin(int sda, int scl);
    void begin();
    bool end() { return true; }
    bool setSDA(uint8_t) { return true; }
    bool setSCL(uint8_t) { return true; }
    bool setClock(uint32_t) { return true; }
    void setTimeOut(uint16_t) {}
    void setTimeout(uint32_t) {}
    void beginTransmission(uint8_t address);
    size_t write(const uint8_t *bytes, size_t size);
    uint8_t endTransmission(bool stop);
    uint8_t requestFrom(uint8_t address, uint8_t size);
    int available();
    int read();
};

extern TwoWire Wire;

#endif

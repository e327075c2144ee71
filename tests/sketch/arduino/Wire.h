/* What the sketches use of Wire: chips are files of registers, whose number a write begins with and that count up. */
#ifndef WIRE_H
#define WIRE_H

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <vector>

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

    std::map<uint8_t, std::array<uint8_t, 256>> chips;  // what is there; others do not acknowledge

private:
    uint8_t address_ = 0;
    std::map<uint8_t, uint8_t> pointers_;
    std::vector<uint8_t> written_;
    std::deque<uint8_t> read_;
};

extern TwoWire Wire;

#endif

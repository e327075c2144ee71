/* What a sketch of rows uses of Arduino's API, on this machine: every call goes to the functions of `world`. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define LOW 0
#define HIGH 1
#define INPUT 0
#define OUTPUT 1
#define INPUT_PULLUP 2
#define F(text) text
#define WL_CONNECTED 3

enum { A0 = 100, A1, A2, A3, A4, A5, A6, A7 };

extern "C" {
struct World {
    uint32_t (*micros)();
    void (*delay)(int us);
    void (*mode)(int pin, int mode);
    void (*write)(int pin, int level);
    int (*read)(int pin);
    int (*analog)(int pin);
    int (*bus_write)(int address, const uint8_t *bytes, int size);
    int (*bus_read)(int address, uint8_t *bytes, int size);
    void (*print)(const char *text);
    int (*wifi)();
    void (*datagram)(const char *host, int port, const char *text);
};
extern World world;
}

inline unsigned long micros() { return world.micros(); }
inline void delayMicroseconds(unsigned us) { world.delay((int)us); }
inline void pinMode(uint8_t pin, uint8_t mode) { world.mode(pin, mode); }
inline void digitalWrite(uint8_t pin, uint8_t level) { world.write(pin, level); }
inline int digitalRead(uint8_t pin) { return world.read(pin); }
inline int analogRead(uint8_t pin) { return world.analog(pin); }

struct SerialPort {
    void begin(unsigned long) {}
    void print(const char *text) { world.print(text); }
};
extern SerialPort Serial;

class TwoWire {
public:
    void begin() {}
    void setClock(uint32_t) {}
    void beginTransmission(uint8_t address)
    {
        address_ = address;
        size_ = 0;
    }
    size_t write(uint8_t byte) { return write(&byte, 1); }
    size_t write(const uint8_t *bytes, size_t size)
    {
        memcpy(&bytes_[size_], bytes, size);
        size_ += size;
        return size;
    }
    uint8_t endTransmission(bool = true) { return world.bus_write(address_, bytes_, (int)size_) != 0 ? 0 : 2; }
    uint8_t requestFrom(uint8_t address, uint8_t size)
    {
        at_ = 0;
        return world.bus_read(address, reply_, size) != 0 ? size : 0;
    }
    int read() { return reply_[at_++]; }

private:
    uint8_t address_, bytes_[32], reply_[32];
    size_t size_, at_;
};
extern TwoWire Wire;

struct IPAddress {
    const char *text;
    bool fromString(const char *address)
    {
        text = address;
        return true;
    }
};

struct WiFiClass {
    int status() { return world.wifi() != 0 ? WL_CONNECTED : 0; }
    void begin(const char *, const char *) { world.datagram("joins", 0, ""); }
};
extern WiFiClass WiFi;

class WiFiUDP {
public:
    int beginPacket(IPAddress host, uint16_t port)
    {
        host_ = host;
        port_ = port;
        return 1;
    }
    void print(const char *text) { world.datagram(host_.text, port_, text); }
    void endPacket() {}

private:
    IPAddress host_;
    uint16_t port_;
};

#endif

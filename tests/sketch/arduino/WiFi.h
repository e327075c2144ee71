/* What the sketches use of WiFi: a network that is there or, as bench.cpp is told, is not. */
#ifndef WIFI_H
#define WIFI_H

#include <stdint.h>

#define WIFI_STA 1
#define WL_CONNECTED 3
#define WL_DISCONNECTED 6

class IPAddress {
public:
    IPAddress(uint32_t address = 0) : address_(address) {}
    operator uint32_t() const { return address_; }

private:
    uint32_t address_;
};

class WiFiClass {
public:
    bool mode(int) { return true; }
    bool setHostname(const char *) { return true; }
    bool setSleep(bool) { return true; }
    void noLowPowerMode() {}
    int begin(const char *, const char *) { return WL_CONNECTED; }
    int status() const { return there ? WL_CONNECTED : WL_DISCONNECTED; }

    bool there = true;
};

extern WiFiClass WiFi;

#endif

/* WiFiUDP over a socket of this machine. Whatever port it is to listen at, it takes a free one of 127.0.0.1, and says so.

   As with arduino-esp32 there is no next datagram as long as one is not read to its end. */
#ifndef WIFI_UDP_H
#define WIFI_UDP_H

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "WiFi.h"

class WiFiUDP {
public:
    uint8_t begin(uint16_t port);
    void stop();
    int beginPacket(IPAddress address, uint16_t port);
    size_t write(const uint8_t *bytes, size_t size);
    int endPacket();
    int parsePacket();
    int available() { return static_cast<int>(received_.size()); }
    int read(uint8_t *bytes, size_t size);
    IPAddress remoteIP() { return from_; }
    uint16_t remotePort() { return from_port_; }

private:
    int descriptor_ = -1;
    std::deque<uint8_t> received_;
    std::vector<uint8_t> sent_;
    IPAddress from_, to_;
    uint16_t from_port_ = 0, to_port_ = 0;
};

#endif

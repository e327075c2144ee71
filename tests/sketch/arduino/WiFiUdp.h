/* WiFiUDP over a socket of this machine. Whatever port it is to listen at, it takes a free one of 127.0.0.1, and says so.

   As with arduino-esp32 there is no next datagram as long as one is not read to its end. */
#ifndef WIFI_UDP_H
#define WIFI_UDP_H

#include <stddef.h>
#include <stdint.h>

#include "WiFi.h"

class WiFiUDP {
public:
    uint8_t begin(uint16_t port);
    void stop();
    int beginPacket(IPAddress address, uint16_t port);
    size_t write(const uint8_t *bytes, size_t size);
    int endPacket();
    int parsePacket();
    int available() { return static_cast<int>(size_ - at_); }
    int read(uint8_t *bytes, size_t size);
    IPAddress remoteIP() { return from_; }
    uint16_t remotePort() { return from_port_; }

private:
    int descriptor_ = -1;
    uint8_t received_[2048], sent_[2048];
    size_t size_ = 0, at_ = 0, to_send_ = 0;
    IPAddress from_, to_;
    uint16_t from_port_ = 0, to_port_ = 0;
};

#endif

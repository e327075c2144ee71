/* The host on Wi-Fi, by UDP: one frame per datagram; thenar_datagram.h describes the header and the choice of the host.

   The name of the network and its password are in secrets.h, which you write: see secrets.example.h.

   thenar 0.1.0, template sketch/thenar_line_udp.cpp.j2. */
#include "thenar_line.h"

#include <Arduino.h>
#include <WiFi.h>
#include <WiFiUdp.h>

#if !__has_include("secrets.h")
#error "copy secrets.example.h to secrets.h, and write the name and the password of your Wi-Fi there"
#endif
#include "secrets.h"

extern "C" {
#include "thenar_board.h"
#include "thenar_clock.h"
#include "thenar_datagram.h"
#include "thenar_turn.h"
}

#define PORT 5253u
#define LOOK_US UINT32_C(100000)     /* period of checks of the network */
#define RETRY_US UINT32_C(15000000)  /* period of reconnections, long enough not to disturb one in progress */

static WiFiUDP udp;
static uint8_t received[THENAR_DATAGRAM_MOST];
static uint16_t at;    /* the next byte to read of those received, and their end */
static uint16_t end;
static bool listening;
static uint32_t looked_us;
static uint32_t tried_us;

/* Return a number that the last boot did not have. */
static uint32_t random_number()
{
    return esp_random();
}

static void join()
{
    tried_us = thenar_clock_us();
    (void)WiFi.begin(THENAR_WIFI_SSID, THENAR_WIFI_PASSWORD);
}

void thenar_line_begin()
{
    (void)WiFi.mode(WIFI_STA);
    (void)WiFi.setHostname("thenar-1");
    (void)WiFi.setSleep(false); /* a sleeping radio replies a tenth of a second late */
    thenar_datagram_begin(random_number());
    join();
}

/* Return whether there is a network; start to listen when it appears. */
static bool attached(uint32_t now_us)
{
    if ((now_us - looked_us) >= LOOK_US) {
        looked_us = now_us;
        if (WiFi.status() != WL_CONNECTED) {
            if (listening) {
                udp.stop();
                listening = false;
            }
            if ((now_us - tried_us) >= RETRY_US) {
                join();
            }
        } else if (!listening) {
            listening = udp.begin(PORT) != 0;
        } else {
            /* all is well */
        }
    }
    return listening;
}

bool thenar_port_send(const uint8_t *frame, uint8_t length)
{
    static uint8_t datagram[THENAR_DATAGRAM_MOST];
    thenar_peer peer;
    const uint16_t size = thenar_datagram_wrap(datagram, frame, length, &peer, thenar_clock_us());
    bool sent = true;

    if (size > 0u) {
        sent = listening && (udp.beginPacket(IPAddress(peer.address), peer.port) != 0)
            && (udp.write(datagram, size) == size) && (udp.endPacket() != 0);
    }
    return sent;
}

/* Take a datagram, if one has arrived; the rest of a longer one is discarded. */
static void receive(uint32_t now_us)
{
    uint8_t scrap[64];

    at = 0u;
    end = 0u;
    if (udp.parsePacket() > 0) {
        const thenar_peer peer = {(uint32_t)udp.remoteIP(), (uint16_t)udp.remotePort()};
        const int size = udp.read(received, sizeof received);
        const bool whole = udp.available() <= 0;

        while (udp.available() > 0) {
            (void)udp.read(scrap, sizeof scrap);
        }
        if (whole && (size > 0) && thenar_datagram_take(received, (uint16_t)size, &peer, now_us)) {
            at = THENAR_DATAGRAM_TO_BOARD;
            end = (uint16_t)size;
        }
    }
}

bool thenar_port_receive(uint8_t *byte)
{
    const uint32_t now_us = thenar_clock_us();

    if ((at == end) && attached(now_us)) {
        receive(now_us);
    }
    if (at < end) {
        *byte = received[at];
        at++;
        return true;
    }
    return false;
}

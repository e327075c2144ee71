/* A board for sketches: its time is this machine's, its pins are wired by lines on standard input.

   wire A B 0|1     open or close a switch between two pins; pin 255 is ground
   analog PIN CODE  what the converter gives
   mux PIN A B C D  a multiplexer of 16 channels at that input, with these pins at S0 to S3
   tap PIN N CODE   what the converter gives of its channel N
   chip KIND ADDRESS             a port expander at the bus
   key KEY ADDRESS PIN           a switch at pin 0 to 23 of one
   close KEY 0|1                 that switch
   plug ADDRESS 0|1              whether the chip is on the bus; it comes back as after power-on
   wifi 0|1         whether there is a network

   It says `udp PORT` and `NAME PATH` of a serial port when the sketch opens them, and `ok` after each line. A serial port
   whose name is in the environment is the one that is there. It ends with its standard input. */
#include "Arduino.h"
#include "WiFi.h"
#include "WiFiUdp.h"
#include "Wire.h"

extern "C" {
#include "board_chips.h"
}

#include <algorithm>
#include <arpa/inet.h>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fcntl.h>
#include <map>
#include <poll.h>
#include <random>
#include <set>
#include <string>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <utility>
#include <vector>

namespace {

constexpr uint8_t ground = 255;

struct Pin {
    uint8_t mode = INPUT;
    uint8_t value = HIGH;
};

Pin pins[256];
int codes[256];
int resolution = 10;
std::set<std::pair<uint8_t, uint8_t>> switches;

struct Mux {
    uint8_t select[4];
    int codes[16];
};
std::map<uint8_t, Mux> muxes;

/* What is under way on the bus. */
std::vector<uint8_t> written;
std::deque<uint8_t> answer;
uint8_t addressed;

[[noreturn]] void stop(const char *what)
{
    std::perror(what);
    std::exit(1);
}

void say(const std::string &line)
{
    std::printf("%s\n", line.c_str());
    std::fflush(stdout);
}

bool drives_low(uint8_t pin)
{
    return pin == ground || (pins[pin].mode == OUTPUT && pins[pin].value == LOW);
}

void obey(const std::string &line)
{
    unsigned first, second, third, fourth, fifth;
    char name[16];

    if (std::sscanf(line.c_str(), "wire %u %u %u", &first, &second, &third) == 3) {
        const std::pair<uint8_t, uint8_t> one(first, second);
        if (third != 0) {
            switches.insert(one);
        } else {
            switches.erase(one);
        }
    } else if (std::sscanf(line.c_str(), "mux %u %u %u %u %u", &first, &second, &third, &fourth, &fifth) == 5) {
        muxes[static_cast<uint8_t>(first)] = {
            {static_cast<uint8_t>(second), static_cast<uint8_t>(third), static_cast<uint8_t>(fourth),
             static_cast<uint8_t>(fifth)},
            {}};
    } else if (std::sscanf(line.c_str(), "tap %u %u %u", &first, &second, &third) == 3) {
        muxes.at(static_cast<uint8_t>(first)).codes[second & 15] = static_cast<int>(third);
    } else if (std::sscanf(line.c_str(), "analog %u %u", &first, &second) == 2) {
        codes[first & 255] = static_cast<int>(second);
    } else if (std::sscanf(line.c_str(), "chip %15s %u", name, &first) == 2) {
        chips_add(name, static_cast<uint8_t>(first));
    } else if (std::sscanf(line.c_str(), "key %u %u %u", &first, &second, &third) == 3) {
        chips_add_key(static_cast<uint16_t>(first), static_cast<uint8_t>(second), static_cast<uint8_t>(third), false);
    } else if (std::sscanf(line.c_str(), "close %u %u", &first, &second) == 2) {
        (void)chips_close(static_cast<uint16_t>(first), second != 0);
    } else if (std::sscanf(line.c_str(), "plug %u %u", &first, &second) == 2) {
        (void)chips_plug(static_cast<uint8_t>(first), second != 0);
    } else if (std::sscanf(line.c_str(), "wifi %u", &first) == 1) {
        WiFi.there = first != 0;
    } else {
        std::fprintf(stderr, "no command: %s\n", line.c_str());
        std::exit(2);
    }
    say("ok");
}

/* Obey what has come in; wait for no longer than a turn of a sketch takes. */
void listen()
{
    static std::string rest;
    pollfd input = {STDIN_FILENO, POLLIN, 0};
    const timespec wait = {0, 20000};

    if (ppoll(&input, 1, &wait, nullptr) > 0) {
        char bytes[4096];
        const ssize_t size = read(STDIN_FILENO, bytes, sizeof bytes);
        if (size <= 0) {
            std::exit(0);
        }
        rest.append(bytes, static_cast<size_t>(size));
        for (size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1)) {
            obey(rest.substr(0, end));
        }
    }
}

}  // namespace

/* What the chips say. */
extern "C" [[noreturn]] void fail(const char *format, ...)
{
    va_list values;

    va_start(values, format);
    std::vfprintf(stderr, format, values);
    va_end(values);
    std::exit(2);
}

unsigned long micros()
{
    static const uint32_t began = [] { return 0xFFF00000u; }();  // its 32 bits wrap after a second
    static timespec first = {0, 0};
    timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    if (first.tv_sec == 0) {
        first = now;
    }
    const int64_t us = (now.tv_sec - first.tv_sec) * 1000000LL + (now.tv_nsec - first.tv_nsec) / 1000;
    return static_cast<uint32_t>(began + static_cast<uint64_t>(us));
}

void delayMicroseconds(unsigned int us)
{
    const uint32_t began = static_cast<uint32_t>(micros());
    while (static_cast<uint32_t>(micros()) - began < us) {
    }
}

void pinMode(uint8_t pin, uint8_t mode)
{
    pins[pin].mode = mode;
}

void digitalWrite(uint8_t pin, uint8_t value)
{
    pins[pin].value = value;
}

int digitalRead(uint8_t pin)
{
    std::set<uint8_t> reached = {pin};
    for (bool grown = true; grown;) {
        grown = false;
        for (const auto &[one, other] : switches) {
            if (reached.count(one) != reached.count(other)) {
                reached.insert(one);
                reached.insert(other);
                grown = true;
            }
        }
    }
    for (const uint8_t each : reached) {
        if (drives_low(each)) {
            return LOW;
        }
    }
    return pins[pin].mode == INPUT_PULLUP ? HIGH : LOW;  // a pin that nobody holds is not to be read
}

void analogReadResolution(int bits)
{
    resolution = bits;
}

int analogRead(uint8_t pin)
{
    const auto mux = muxes.find(pin);
    int code = codes[pin];
    if (mux != muxes.end()) {
        unsigned channel = 0;
        for (unsigned bit = 0; bit < 4; bit++) {
            const Pin &select = pins[mux->second.select[bit]];
            channel |= (select.mode == OUTPUT && select.value == HIGH) ? 1u << bit : 0u;
        }
        code = mux->second.codes[channel];
    }
    return code & ((1 << resolution) - 1);
}

uint32_t esp_random()
{
    return std::random_device{}();
}

uint32_t Rp2040::hwrand32()
{
    return std::random_device{}();
}

Rp2040 rp2040;
WiFiClass WiFi;
TwoWire Wire;
SerialPort Serial("serial"), Serial1("serial1"), Serial2("serial2");

void SerialPort::begin(unsigned long, uint32_t, int, int)
{
    termios raw;

    if (const char *there = std::getenv(name_)) {
        descriptor_ = open(there, O_RDWR | O_NOCTTY | O_NONBLOCK);
        if (descriptor_ < 0) {
            stop(there);
        }
        return;
    }
    descriptor_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (descriptor_ < 0 || grantpt(descriptor_) != 0 || unlockpt(descriptor_) != 0) {
        stop("pty");
    }
    const int other = open(ptsname(descriptor_), O_RDWR | O_NOCTTY);  // kept open: nobody hangs up
    if (other < 0 || tcgetattr(other, &raw) != 0) {
        stop("pty");
    }
    cfmakeraw(&raw);
    tcsetattr(other, TCSANOW, &raw);
    say(std::string(name_) + " " + ptsname(descriptor_));
}

int SerialPort::availableForWrite()
{
    return 1024;
}

size_t SerialPort::write(const uint8_t *bytes, size_t size)
{
    const ssize_t sent = ::write(descriptor_, bytes, size);
    return sent < 0 ? 0 : static_cast<size_t>(sent);
}

int SerialPort::read()
{
    uint8_t byte;
    return ::read(descriptor_, &byte, 1) == 1 ? byte : -1;
}

bool TwoWire::begin(int, int)
{
    return true;
}

void TwoWire::begin() {}

void TwoWire::beginTransmission(uint8_t address)
{
    addressed = address;
    written.clear();
}

size_t TwoWire::write(const uint8_t *bytes, size_t size)
{
    written.insert(written.end(), bytes, bytes + size);
    return size;
}

uint8_t TwoWire::endTransmission(bool)
{
    if (!chips_start(addressed)) {
        return 2;
    }
    for (const uint8_t byte : written) {
        if (!chips_write(byte)) {
            return 3;
        }
    }
    return 0;
}

uint8_t TwoWire::requestFrom(uint8_t address, uint8_t size)
{
    answer.clear();
    if (chips_start(address)) {
        for (uint8_t at = 0; at < size; at++) {
            answer.push_back(chips_read());
        }
    }
    return static_cast<uint8_t>(answer.size());
}

int TwoWire::available()
{
    return static_cast<int>(answer.size());
}

int TwoWire::read()
{
    if (answer.empty()) {
        return -1;
    }
    const int byte = answer.front();
    answer.pop_front();
    return byte;
}

uint8_t WiFiUDP::begin(uint16_t)
{
    sockaddr_in here = {};
    socklen_t size = sizeof here;

    descriptor_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    here.sin_family = AF_INET;
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (descriptor_ < 0 || bind(descriptor_, reinterpret_cast<sockaddr *>(&here), size) != 0) {
        return 0;
    }
    getsockname(descriptor_, reinterpret_cast<sockaddr *>(&here), &size);
    say("udp " + std::to_string(ntohs(here.sin_port)));
    return 1;
}

void WiFiUDP::stop()
{
    close(descriptor_);
    descriptor_ = -1;
    size_ = at_ = 0;
}

int WiFiUDP::beginPacket(IPAddress address, uint16_t port)
{
    to_ = address;
    to_port_ = port;
    to_send_ = 0;
    return 1;
}

size_t WiFiUDP::write(const uint8_t *bytes, size_t size)
{
    const size_t taken = std::min(size, sizeof sent_ - to_send_);
    std::memcpy(&sent_[to_send_], bytes, taken);
    to_send_ += taken;
    return taken;
}

int WiFiUDP::endPacket()
{
    sockaddr_in there = {};

    there.sin_family = AF_INET;
    there.sin_addr.s_addr = to_;
    there.sin_port = htons(to_port_);
    return sendto(descriptor_, sent_, to_send_, 0, reinterpret_cast<sockaddr *>(&there), sizeof there) >= 0;
}

int WiFiUDP::parsePacket()
{
    sockaddr_in from = {};
    socklen_t size = sizeof from;

    if (available() > 0) {
        return 0;
    }
    const ssize_t got =
        recvfrom(descriptor_, received_, sizeof received_, 0, reinterpret_cast<sockaddr *>(&from), &size);
    size_ = got > 0 ? static_cast<size_t>(got) : 0;
    at_ = 0;
    from_ = from.sin_addr.s_addr;
    from_port_ = ntohs(from.sin_port);
    return static_cast<int>(size_);
}

int WiFiUDP::read(uint8_t *bytes, size_t size)
{
    const size_t taken = std::min(size, size_ - at_);
    std::memcpy(bytes, &received_[at_], taken);
    at_ += taken;
    return static_cast<int>(taken);
}

int main()
{
    setup();
    for (;;) {
        listen();
        loop();
    }
}

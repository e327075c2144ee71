/* board: prints what a glove's sensors read, a line for each row.

     $columns,thumb_tip,index_tip,index_mcp*0E     once a second: the names of the switches, then of the readings
     $row,17,3400112,3,512*5C                      number of the row, clock, switches, then every reading

   The row's number is 0 to 65535, then 0 again. The clock is micros(). Switches are a hexadecimal number whose bit k is
   switch k, 1 is closed. Readings are what analogRead() returns. The two digits after the asterisk are the exclusive or
   of all bytes between it and the dollar sign. Rows in which a chip does not reply are left out.

   An ESP32 or a Pico W can send the lines by Wi-Fi, as UDP datagrams: write a file secrets.h next to this one with

     #define SSID "..."
     #define PASSWORD "..."
     #define HOST "192.168.1.20"     the address of the computer that runs thenar
     #define PORT 5253               its port: in glove.toml, port = "udp://0.0.0.0:5253"

   thenar 0.1.0, template rows/NAME.ino.j2. */
#include <Arduino.h>
#include <Wire.h>

#if __has_include("secrets.h")
#include <WiFi.h>
#include <WiFiUdp.h>

#include "secrets.h"
#define BY_WIFI
#endif

#define BAUD 115200
#define ROW_US 10000ul  // from row to row
#define COLUMNS_US 1000000ul  // from one line of columns to the next
#define LONGEST_ROW 41  // bytes

/* The switches that are closed, four in a byte: the digits of the row's number, the last digit first. */
static uint8_t nibbles[2];

static void put_switch(uint16_t number, bool closed)
{
    if (closed) {
        nibbles[number / 4] |= (uint8_t)(1u << number % 4);
    }
}

static uint16_t readings[2];

/* One row at a time is driven low; the others are pulled up: a floating wire would carry its charge to the next one. */
static void drive_row(uint8_t pin)
{
    pinMode(pin, OUTPUT);
    digitalWrite(pin, LOW);
    delayMicroseconds(20);
}

/* Write bytes to a chip, the first of which is the number of a register. */
template <typename... Bytes> bool write_chip(uint8_t address, Bytes... bytes)
{
    const uint8_t data[] = {(uint8_t)bytes...};

    Wire.beginTransmission(address);
    Wire.write(data, sizeof data);
    return Wire.endTransmission() == 0;
}

/* Read the bytes of a chip from a register on. */
static bool read_chip(uint8_t address, uint8_t first, uint8_t *reply, uint8_t count)
{
    Wire.beginTransmission(address);
    Wire.write(first);
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(address, count) != count) {
        return false;
    }
    for (uint8_t byte = 0; byte < count; byte++) {
        reply[byte] = (uint8_t)Wire.read();
    }
    return true;
}

/* Return whether a chip has these bytes in its registers, from the first on. */
template <typename... Bytes> bool chip_has(uint8_t address, uint8_t first, Bytes... bytes)
{
    const uint8_t expected[] = {(uint8_t)bytes...};
    uint8_t reply[sizeof expected];

    return read_chip(address, first, reply, sizeof reply) && memcmp(reply, expected, sizeof reply) == 0;
}

/* Make the pins of the chips inputs, and read back what was written. */
static bool set_up_chips()
{
    return true
        /* mcp23017 at 0x20 */
        && write_chip(0x20, 0x05, 0x00)
        && write_chip(0x20, 0x0A, 0x04)
        && chip_has(0x20, 0x0A, 0x04, 0x04)
        && write_chip(0x20, 0x00, 0xFF, 0xFF, 0x00, 0x00, 0x00, 0x00)
        && chip_has(0x20, 0x00, 0xFF, 0xFF, 0x00, 0x00, 0x00, 0x00)
        && write_chip(0x20, 0x0A, 0x04, 0x04, 0x89, 0x81)
        && chip_has(0x20, 0x0A, 0x04, 0x04, 0x89, 0x81)
        ;
}

/* Return whether all chips reply and are still set up: bits that a chip would then pull up are 1. */
static bool read_chips()
{
    uint8_t reply[3];

    /* mcp23017 at 0x20 */
    if (!read_chip(0x20, 0x12, reply, 2) || (reply[0] & 0x80) != 0x80 || (reply[1] & 0x80) != 0x80) {
        return false;
    }
    put_switch(3, !(reply[0] & 0x01)); /* middle tip */
    put_switch(4, !(reply[0] & 0x08)); /* palm radial */
    put_switch(5, !(reply[1] & 0x01)); /* palm ulnar */
    return true;
}

static void select_channel(uint8_t channel)
{
    digitalWrite(4, channel & 1 ? HIGH : LOW);
    digitalWrite(5, channel & 2 ? HIGH : LOW);
    digitalWrite(6, channel & 4 ? HIGH : LOW);
    digitalWrite(7, channel & 8 ? HIGH : LOW);
    delayMicroseconds(100);
}

#ifdef BY_WIFI
static WiFiUDP udp;

template <typename Text> void send_line(Text line)
{
    IPAddress host;

    if (WiFi.status() == WL_CONNECTED && host.fromString(HOST) && udp.beginPacket(host, PORT) != 0) {
        udp.print(line);
        udp.endPacket();
    }
}

/* Join the network, and join it again when it was lost for ten seconds. */
static void attend_wifi()
{
    static uint8_t seconds;

    if (WiFi.status() == WL_CONNECTED) {
        seconds = 1;
    } else if (seconds++ % 10 == 0) {
        WiFi.begin(SSID, PASSWORD);
    }
}
#else
template <typename Text> void send_line(Text line)
{
    Serial.print(line);
}
#endif

static void send_columns()
{
    send_line(F("$columns"
        ",thumb tip"
        ",index tip"
        ",index middle"
        ",middle tip"
        ",palm radial"
        ",palm ulnar"
        ",thumb_rotation"
        ",index_pij"
        "*66\r\n"));
}

/* Read everything, and return whether all has replied. */
static bool read_inputs()
{
    static bool ready;

    memset(nibbles, 0, sizeof nibbles);
    ready = (ready || set_up_chips()) && read_chips();
    if (!ready) {
        return false;
    }
    put_switch(0, digitalRead(2) == LOW); /* thumb tip */
    drive_row(8);
    put_switch(1, digitalRead(10) == LOW); /* index tip */
    pinMode(8, INPUT_PULLUP);
    drive_row(9);
    put_switch(2, digitalRead(10) == LOW); /* index middle */
    pinMode(9, INPUT_PULLUP);
    readings[0] = (uint16_t)analogRead(A0); /* thumb_rotation */
    select_channel(3);
    readings[1] = (uint16_t)analogRead(A1); /* index_pij */
    return true;
}

static void send_row(uint32_t now_us)
{
    static uint16_t row_number;
    const uint16_t number = row_number++;
    char row[LONGEST_ROW + 1];
    uint8_t sum = 0;

    if (!read_inputs()) {
        return;
    }
    size_t end = (size_t)snprintf(row, sizeof row, "$row,%u,%lu,", (unsigned)number, (unsigned long)now_us);
    for (size_t digit = sizeof nibbles; digit > 0; digit--) {
        row[end++] = "0123456789ABCDEF"[nibbles[digit - 1]];
    }
    for (const uint16_t reading : readings) {
        end += (size_t)snprintf(row + end, sizeof row - end, ",%u", (unsigned)reading);
    }
    for (size_t at = 1; at < end; at++) {
        sum ^= (uint8_t)row[at];
    }
    snprintf(row + end, sizeof row - end, "*%02X\r\n", (unsigned)sum);
    send_line((const char *)row);
}

void setup()
{
    Serial.begin(BAUD);
    Wire.begin();
    Wire.setClock(400000);
#ifdef WIRE_HAS_TIMEOUT
    Wire.setWireTimeout(3000, true);  // a wire that comes off in the middle of a byte must not stop the board
#endif
    pinMode(2, INPUT_PULLUP);
    pinMode(8, INPUT_PULLUP);
    pinMode(9, INPUT_PULLUP);
    pinMode(10, INPUT_PULLUP);
    pinMode(4, OUTPUT);
    pinMode(5, OUTPUT);
    pinMode(6, OUTPUT);
    pinMode(7, OUTPUT);
}

void loop()
{
    static uint32_t columns_us = (uint32_t)micros() - COLUMNS_US;
    static uint32_t row_us = (uint32_t)micros() - ROW_US;
    const uint32_t now_us = (uint32_t)micros();

    if (now_us - columns_us >= COLUMNS_US) {
        columns_us = now_us;
#ifdef BY_WIFI
        attend_wifi();
#endif
        send_columns();
    }
    if (now_us - row_us >= ROW_US) {
        row_us += ROW_US;
        if (now_us - row_us >= ROW_US) {  // late by a row or more: go on from here
            row_us = now_us;
        }
        send_row(now_us);
    }
}

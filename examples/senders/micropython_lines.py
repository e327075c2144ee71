"""Prints a row of a glove 50 times a second: a clock, two switches, a flex sensor and a pad. MicroPython (Pico, ESP32).

mpremote cp micropython_lines.py :main.py + reset
thenar doctor --line /dev/ttyACM0 --propose glove.toml
"""

import time

from machine import ADC, Pin  # pyright: ignore[reportMissingImports]

SWITCHES = [Pin(number, Pin.IN, Pin.PULL_UP) for number in (14, 15)]  # each connects its pin to ground
ANALOG = [ADC(Pin(number)) for number in (26, 27)]

print("ms,thumb,index,flex_index,pad_palm")
due = time.ticks_ms()
while True:
    row = [time.ticks_ms()]
    row += [1 - pin.value() for pin in SWITCHES]
    row += [converter.read_u16() for converter in ANALOG]
    print(*row, sep=",")
    due = time.ticks_add(due, 20)
    time.sleep_ms(max(0, time.ticks_diff(due, time.ticks_ms())))

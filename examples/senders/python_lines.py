"""Sends a row of a glove 50 times a second to a serial port: a clock, two switches, a flex sensor and a pad.

    python python_lines.py /dev/ttyGS0

Put what your hardware says in place of sines. At the other end: thenar doctor --line /dev/ttyACM0 --propose glove.toml
"""

import sys
import time
from math import sin

import serial

with serial.Serial(sys.argv[1], 115200) as line:
    line.write(b"ms,thumb,index,flex_index,pad_palm\n")
    began = time.monotonic()
    while True:
        now = time.monotonic() - began
        row = [round(1000 * now), sin(now) > 0, sin(2 * now) > 0, 45 + 40 * sin(now), 500 + 400 * sin(3 * now)]
        line.write((",".join(f"{number:.6g}" for number in row) + "\n").encode())
        time.sleep(0.02 - now % 0.02)

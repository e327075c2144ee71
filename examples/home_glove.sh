#!/bin/sh -e
# From the table of a glove built at home to firmware, in nine commands. docs/tutorials/your-own-table.md explains them.
#
#     sh home_glove.sh            makes everything in the folder home_glove/
#
# 24 pads (FSR) read by a converter of 12 bits and 5 flex sensors, six people, several frames a trial. The table is
# simulated, by home_glove.py: put your own in its place, with TABLE=mine.csv.

here=$(cd "$(dirname "$0")" && pwd)
mkdir -p home_glove && cd home_glove
TABLE=${TABLE:-table.csv}
[ -e "$TABLE" ] || python3 "$here/home_glove.py" "$TABLE"

# What the columns are is found out; pads become taxels, of which a placement chooses levels.
thenar import "$TABLE" -o set.grasps --yes --overwrite
# How many grasps of whom, what the pads read, and how well they can tell the grasps apart.
thenar info set.grasps --plot set.png --overwrite
# Rates for people whom nothing was learnt from, placement inside the folds.
thenar evaluate set.grasps --by subject --tables compositions --trainer linear -o rates.json --overwrite
# Which pads and levels are worth keeping.
thenar place set.grasps --method elimination --keep 16 -o kept.json --overwrite
# The build: integer tables with their proof, report and spec.
thenar compile set.grasps -o build --method elimination --keep 16 --trainer linear --folds 0
# Every row through floats and integers: they must agree.
thenar verify build set.grasps
# The grasps of the recordings, as a live glove would announce them.
thenar run build --replay set.grasps > grasps.jsonl
# The classifier for an Arduino Uno's microcontroller, and for this machine.
thenar firmware build --target avr328p -o firmware-avr --overwrite
thenar firmware build --target host -o firmware-host --overwrite

"""What a frontier's points are timed for: microcontrollers and cores, this machine, a Raspberry Pi."""

TARGETS = ("avr328p", "avr2560", "cortex-m0plus", "cortex-m4", "host", "pi")

"""What the firmware that every build carries is called."""

LIBRARY_NAME = "glove"
"""What the library is called unless it is named: its files are thenar_glove.h and so on, its functions alike."""

FIRMWARE_NAME = "firmware"
LIBRARY_FILES = tuple(f"thenar_{LIBRARY_NAME}{ending}" for ending in (".h", ".c", "_avr.S"))

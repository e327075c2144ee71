"""Firmware: a build as C99, arranged for the microcontroller that it is for."""

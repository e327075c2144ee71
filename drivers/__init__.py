"""Wire protocols of gloves, boards and port expanders, and emulations of these devices.

Imports no other package of thenar. Logs wire events to the loggers `thenar.drivers...`, which are silent by default.
"""

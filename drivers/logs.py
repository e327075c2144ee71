"""The drivers' loggers, which are silent until a program adds a handler."""

import logging

logging.getLogger("thenar.drivers").addHandler(logging.NullHandler())
logger = logging.getLogger

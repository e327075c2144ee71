"""Wire protocols of gloves, scanners and port expanders, and the same devices emulated. Imports nothing else of thenar.

What happens on the wires goes to the loggers `thenar.drivers...`, and nowhere as long as nobody listens.
"""

import logging

logging.getLogger(__name__).addHandler(logging.NullHandler())

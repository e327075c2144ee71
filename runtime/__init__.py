"""The live side: a build folder in, grasp types out. Imports with the base dependencies alone."""

from .build import Build
from .errors import BuildError, FrameError, SealError, ThenarError
from .recognizer import Recognition, Recognizer

__all__ = ["Build", "BuildError", "FrameError", "Recognition", "Recognizer", "SealError", "ThenarError"]

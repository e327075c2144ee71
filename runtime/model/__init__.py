"""Additive models, in floating point and in integers, and what is proved of them: numpy alone, for boards too."""

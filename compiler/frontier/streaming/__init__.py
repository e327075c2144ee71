"""Streams of grasps, recorded or composed, and how long a decision takes on them."""

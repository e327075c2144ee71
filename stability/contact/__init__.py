"""Grasps that are hard to bring to rest, the truth at 60 digits of where they came to rest, and steps halved."""

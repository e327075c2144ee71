"""The effects, one per module: `MEMBER` is its record (pipeline/effect.py)."""

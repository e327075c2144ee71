"""The effects, one module each: `MEMBER` is the record of it (pipeline/effect.py)."""

"""The effects, one module each, imported only when a scene lists them (registry.py)."""

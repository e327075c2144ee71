"""Segments of whole movements: learnt from recordings, found in them, scored, written and drawn."""

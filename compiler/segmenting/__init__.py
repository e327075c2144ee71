"""Segments of whole movements: learn them from recordings, find, score, write and draw them."""

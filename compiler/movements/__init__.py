"""Movements: which rows belong together in time; their segments, learnt, scored, written and drawn."""

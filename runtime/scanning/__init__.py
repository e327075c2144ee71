"""Scan maps: the fewest transactions that read the kept switches."""

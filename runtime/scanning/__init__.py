"""Scan maps: the fewest transactions that read the kept switches, in the order that decides earliest."""

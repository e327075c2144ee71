"""Numerically hard inputs: constructed by rule, or random from a seed."""

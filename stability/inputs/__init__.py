"""Inputs that are hard on the numbers: made by rule, or drawn from a seed."""

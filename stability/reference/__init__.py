"""Reference values at 60 digits: the formulas again, with mpmath, independent of thenar's code."""

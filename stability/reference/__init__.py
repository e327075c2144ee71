"""The truth at 60 digits: the formulas once more, with mpmath, independent of thenar and importing none of it."""

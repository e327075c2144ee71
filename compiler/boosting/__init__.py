"""LogitBoost on decision stumps, as Weka 3.6 computes it, with exact sums."""

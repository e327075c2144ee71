"""What cases share: what is computed of hard inputs, the truth of it, and how far rounding may take it."""

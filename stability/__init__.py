"""The hard cases: what could go wrong with the numbers, the truth each is held against, and the error."""

"""The reduced glove, ready to build: switch positions, wiring, materials, and expected performance."""

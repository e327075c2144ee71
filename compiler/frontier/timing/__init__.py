"""Times of reading and classifying: predicted, simulated, measured, and compared with each other."""

"""What reading and classifying take: predicted, simulated, measured, and held against one another."""

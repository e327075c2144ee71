"""Trainers, which fit a model to samples: LogitBoost, and other models that are a sum over inputs."""

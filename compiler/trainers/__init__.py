"""What makes a recogniser of samples: LogitBoost, and whatever else gives a sum over inputs."""

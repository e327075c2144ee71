"""Contact models: the rest of gripping hands, and the forces on the switches."""

"""The simulated bodies: hands, gloves and objects, and their poses."""

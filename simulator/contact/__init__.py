"""Contact models: how hands told to grip come to rest, and what that does to the switches."""

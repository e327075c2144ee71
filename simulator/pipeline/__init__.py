"""Effects and the glove's own steps, compiled from a scene into one list, and what they work on."""

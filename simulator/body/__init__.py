"""What is simulated: hands, gloves and objects, and how they lie."""

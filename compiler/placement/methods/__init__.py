"""Ways to choose switches, a file a method or a family of them: `base` says what a method is, and finds them all."""

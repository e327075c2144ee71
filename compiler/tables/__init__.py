"""From an ensemble of stumps to score tables, and from those to integers, with proved bounds."""

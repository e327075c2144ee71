"""Which switches to keep: ID3 with pruning, as the paper does it, and baselines to compare it with."""

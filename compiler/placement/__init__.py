"""Which switches to keep: ID3 with pruning, as the paper does it, and rivals to hold beside it."""

"""The additive multinomial logit: score tables fitted at once, by a convex problem."""

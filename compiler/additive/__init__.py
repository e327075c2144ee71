"""The additive multinomial logit: all score tables fitted at once by convex optimisation."""

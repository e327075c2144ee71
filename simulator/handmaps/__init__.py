"""Hand maps: the glove in the view of the wearer's own palm."""

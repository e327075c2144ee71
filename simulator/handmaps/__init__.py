"""Hand maps: the glove as one sees one's own palm."""

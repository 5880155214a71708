"""A look-up table of one robot."""

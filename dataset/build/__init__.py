"""A sweep, from its design to a finished data set."""

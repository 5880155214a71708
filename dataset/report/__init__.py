"""A data set at a glance."""

"""Least squares with a scatter of the sessions, and the scatter between repeats."""

"""Slow, independent solutions of the same problems, for tests and teaching: tensors, framed rod, linear theory."""

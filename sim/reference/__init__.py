"""Slow and independent ways to the same answers, for tests and teaching: tensors, framed rods, linear theory."""

"""Slow and simple answers that tests and benchmarks hold the quick ones against."""

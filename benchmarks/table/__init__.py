"""Benchmarks of look-up tables."""

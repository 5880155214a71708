"""Analytic and published reference values, with their sources."""

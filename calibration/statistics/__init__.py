"""Fits, residual tests and their statistics; independent of robots."""

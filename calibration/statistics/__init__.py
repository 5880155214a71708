"""Fits, residual tests and their statistics; knows no robots."""

"""Figures that the README claims, one script each; `python -m benchmarks.run` runs them all."""

"""Programs that print the figures in the documentation, in rooms; `python -m benchmarks` lists and runs them."""

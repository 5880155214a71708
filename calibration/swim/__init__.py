"""Swims of a robot as measurements: tracks with the motor's flips, their model and noise."""

"""The robot as a vehicle with two twists."""

"""The robot as a model of measured runs."""

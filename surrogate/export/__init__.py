"""The look-up table for other programs."""

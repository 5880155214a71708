"""Paths in the plane: geometry only."""

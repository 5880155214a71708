"""Simulator of the swimming robot: discrete elastic rods with resistive force theory."""

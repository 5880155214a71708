"""Simulator of the swimming robot: batched discrete elastic rods with resistive force theory."""

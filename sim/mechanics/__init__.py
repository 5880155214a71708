"""Formulas of rods, drag, flow and contact, and of motion in the plane. No solver, no unknowns."""

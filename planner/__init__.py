"""Planner: from a path in the plane to the motor's switching times, without simulating."""

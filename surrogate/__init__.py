"""Neural look-up table: from a robot's dimensionless groups to its motion, without simulating."""

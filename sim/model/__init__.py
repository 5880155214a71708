"""What a robot is: in SI units, in dimensionless groups, and as the numbers that its balance of forces reads."""

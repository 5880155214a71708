"""Files of plans: written and read."""

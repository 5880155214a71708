"""From a pose to a pose, around obstacles."""

"""What a row of a sweep is."""

"""What a plan is written to and read from."""

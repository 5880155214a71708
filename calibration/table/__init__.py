"""What the rows of a table say: read, excluded, compared with each other; independent of any model."""

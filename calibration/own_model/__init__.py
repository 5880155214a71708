"""A model of one's own: a function, its table, and what it may lack."""

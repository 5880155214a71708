"""Data sets: robots drawn over the inputs, simulated in parallel, stored as Parquet."""

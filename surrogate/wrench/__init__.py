"""The tails' and the head's wrench, and their balance: formulas only."""

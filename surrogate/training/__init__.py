"""From rows of simulations to a trained look-up table."""

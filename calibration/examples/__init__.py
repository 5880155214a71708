"""Models other than the swimmer: the engine that closes the loop knows no robots."""

"""Jobs of a laboratory: paths that keep clear of obstacles, tours of places, and coverage of regions."""

"""Jobs of a laboratory: paths clear of obstacles, tours of places, coverage of regions."""

"""Jobs of a laboratory: paths clear of obstacles, tours of places, places to hold."""

"""From a film of a tank to tracks of robots: markers, poses with errors, spins."""

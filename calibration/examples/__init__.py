"""Models other than the swimmer. The calibration itself knows nothing about robots."""

"""The verdict of a calibration, and the next runs."""

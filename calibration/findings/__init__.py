"""What a calibration found: the numbers, their record, and the next runs."""

"""What a calibration hands on."""

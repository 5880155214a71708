"""Calibration: from a table of measurements to a corrected robot, with the evidence."""

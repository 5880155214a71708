"""Calibration: from a table of measurements to a corrected robot, with the evidence for the correction."""

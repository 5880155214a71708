"""What a calibration of a robot has beyond that of any model: the corrected robot."""

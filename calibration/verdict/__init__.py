"""The procedure of a calibration, and its verdict."""

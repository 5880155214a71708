"""The schedule corrected by measured poses."""

"""What a calibration says: templates over the content of verdict.json, and numbers as people read them."""

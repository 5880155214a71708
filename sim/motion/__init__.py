"""What users ask for: steady motion, response to switches, replays, sensitivities; many robots at once."""

"""The law of guidance, in loops that are compiled when a file of this folder changes."""

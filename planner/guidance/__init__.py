"""When the motor flips: the law, in loops that are compiled when a file of this folder changes, and schedules."""

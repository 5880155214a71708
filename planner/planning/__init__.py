"""From a path to a schedule with a stated error."""

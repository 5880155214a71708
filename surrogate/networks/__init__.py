"""Networks and their training; independent of robots."""

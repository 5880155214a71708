"""Networks and their training; knows no robots."""

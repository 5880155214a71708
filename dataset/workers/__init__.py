"""Processes and machines that simulate rows."""

"""The public functions that span packages."""

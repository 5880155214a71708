"""Tests of the public functions that span packages."""

"""The look-up table and its query: what planning needs, nothing more."""

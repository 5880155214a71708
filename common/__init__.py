"""What comes in and goes out: errors, whole files, tables, pages, command lines."""

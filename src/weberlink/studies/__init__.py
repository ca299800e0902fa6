"""Studies: each folder has a command, its figures and its document."""

"""A day of the learned path in a few minutes."""

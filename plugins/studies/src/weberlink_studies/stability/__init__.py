"""Stability study: sampled walls and whole systems, on paper and measured."""

"""The bridge to Foxglove."""

"""Study of the `adaptive` predictor: packets, felt force, the worth of each part, and run time."""

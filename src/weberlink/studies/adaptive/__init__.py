"""Study of the `adaptive` predictor: packets against the paper's hybrid and the best single predictor, by source."""

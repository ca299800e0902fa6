"""Files of sessions with estimated predictors."""

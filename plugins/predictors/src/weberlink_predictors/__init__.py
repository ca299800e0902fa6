"""Predictors that the sender estimates, the choice among them by their record, and more shapes of the deadband."""

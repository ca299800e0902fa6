"""Recorded signals through the codec: traces, predictors and Weber factors in, one row of figures for each out."""

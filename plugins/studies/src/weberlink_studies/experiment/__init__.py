"""Experiment of the paper: a person feels and rates blind trials; analysis of the ratings."""

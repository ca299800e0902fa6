"""Recorded signals through the codec: many traces, predictors and Weber factors into rows of figures.

`replay` runs a trace through the daemons' own encoder and decoder, `perception` says what of the error a person could
notice, `row` puts figures together, and `sweep` says what is varied. How the work is shared is not known here.
"""

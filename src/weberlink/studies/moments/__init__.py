"""One coded signal, tick by tick: what was displayed, which model was in use, and drawings of it."""

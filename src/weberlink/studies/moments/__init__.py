"""One coded signal tick by tick: displayed forces, models in use, and figures of single moments."""

"""Control schemes that keep a delayed loop stable, and the interface of a port. Pure; see `table` for the schemes."""

"""Control schemes that keep a delayed loop stable, the interface of a port, and live changes of settings; all pure."""

"""Error against run time: the integrators of the simulated robot on problems whose solutions are known to 1e-9."""

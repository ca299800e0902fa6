"""Real time on Linux: the tick, rights of the process, garbage collection, and the event loop of a daemon."""

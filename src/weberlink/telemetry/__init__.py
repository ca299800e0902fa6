"""One fixed-size record per tick in shared memory: written by a daemon, read by other processes."""

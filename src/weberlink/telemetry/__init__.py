"""One fixed-size record per tick in shared memory: written by a daemon, read by observers in other processes.

The writer never waits for a reader and does not notice when one dies. Knows no codec, no session and no device:
states, faults and predictors are small numbers here. Nothing is imported here, so that a daemon loads only the
writer, which needs no numpy.
"""

"""Real time on Linux: the tick, what the process may ask of the kernel, and the loop that runs one daemon.

Knows no codec, no protocol and no device: a side and a transport are handed in as objects of the protocols in `shell`.
Nothing is imported here, so that a program which only wants the `histogram` does not load the event loop.
"""

"""The way to the other host: pairing by code, paths through any NAT, servers of one's own.

Nothing here is imported unless a file or a command asks for it.
"""

"""Telemetry of another host, to be looked at and nothing else.

Over TCP, since figures need every record in order, and a slow link is to hold up nothing but this: the ring is the
queue, and what it cannot hold is counted as lost. Both ends prove the pre-shared key of the daemons, under a key of its
own derived from it, so that no message of the one protocol is one of the other. What follows is encrypted, and bound to
its place in the stream: bytes that were changed, repeated, left out or put elsewhere end the connection.

Nothing that the looking end can say is a request; the sharing end reads signs of life and no more.

- `handshake`, `channel`, `messages`: pure; who may look, how a message is sealed, what it says.
- `sharing`, `following`: the two ends on asyncio streams; `wire` moves frames for both.
- `source`, `clock`, `joining`: what arrives as feeds of a session, on one clock with a master of this host.
"""

"""Shares telemetry with another host, for viewing only.

It uses TCP, since figures need every record in order; the rings are the queue, and what they cannot hold is counted as
lost. Both ends prove the pre-shared key. The viewing end sends nothing but signs of life.

- `stream`: the authenticated, encrypted stream; `messages`: what is sent over it.
- `sharing`, `following`: the two ends; `feeds`: received records as feeds; `joining`: with a side of this host.
"""

"""What is plugged into this host, and how to talk to it without blocking a tick.

Owns discovery, ports with clear complaints, the thread that owns a blocking device, and the shell around an emulated
one. Knows no device: what the bytes mean is the business of the drivers in `master.devices` and `slave.robots`.
"""

"""The shell that gives an endpoint a socket and timers: the only part of `protocol` that does I/O."""

from weberlink.protocol.aio.udp import AddressInUseError, UdpShell

__all__ = ["AddressInUseError", "UdpShell"]

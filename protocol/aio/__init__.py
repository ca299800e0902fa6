"""The shell that gives an endpoint sockets and timers: the only part of `protocol` that does I/O."""

from weberlink.protocol.aio.sockets import AddressInUseError
from weberlink.protocol.aio.udp import UdpShell

__all__ = ["AddressInUseError", "UdpShell"]

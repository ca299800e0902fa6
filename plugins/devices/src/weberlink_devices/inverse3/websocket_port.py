"""The client's end of a WebSocket with exclusive use by one thread; every wait has a time limit.

The protocol of `websockets` without input and output runs on a plain socket: no second thread stands between a message
and the one who waits for it, and a guardian process can write on the same connection.
"""

import errno
import os
import socket
from collections import deque
from contextlib import suppress
from select import select
from time import monotonic

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidURI
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

from weberlink.hardware.fault import HardwareFault
from weberlink.hardware.guardian import Guardian

CHUNK = 65536
LONGEST_MESSAGE = 1 << 20
"""[bytes]"""
DATA = (Opcode.TEXT, Opcode.BINARY, Opcode.CONT)


def text_frame(text: str) -> bytes:
    """A message of a client as it is on the wire, to be written at any time between two others."""
    return Frame(Opcode.TEXT, text.encode()).serialize(mask=True)


class WebSocketPort:
    """An open connection; raises HardwareFault where nobody answers within `patience` [s], or not as a WebSocket."""

    def __init__(self, address: str, patience: float) -> None:
        self.address = address
        self._guardian: Guardian | None = None
        self._heard: deque[bytes] = deque()
        self._parts: list[bytes] = []
        until = monotonic() + patience
        try:
            uri = parse_uri(address)
            self._protocol = ClientProtocol(uri, max_size=LONGEST_MESSAGE)
            self._socket = socket.create_connection((uri.host, uri.port), patience)
        except InvalidURI:
            raise HardwareFault(f"{address}: this is no address of a WebSocket; expected ws://HOST:PORT") from None
        except OSError as error:
            raise HardwareFault(f"{address}: {_reason(error)}") from None
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setblocking(False)
            self._shake_hands(until)
        except BaseException:
            self._socket.close()
            raise

    def guard(self, guardian: Guardian) -> None:
        """Let a guardian watch the connection until it is closed; its `zero` must be known."""
        guardian.watch(self._socket.fileno())
        self._guardian = guardian

    def send(self, text: str, *, rest: bool) -> None:
        """Send a message; `rest` says that it carries no force. Raises HardwareFault, also as `Guardian.before`."""
        if self._protocol.state is not State.OPEN:
            raise HardwareFault(f"{self.address}: closed the connection")
        self._protocol.send_text(text.encode())
        data = b"".join(self._protocol.data_to_send())
        guardian = self._guardian
        if guardian is None:
            self._write(data)
        elif rest:
            self._write(data)
            guardian.after(guardian.zero)
        else:
            guardian.before(data)
            self._write(data)
            guardian.after(data)

    def receive(self, until: float) -> bytes | None:
        """The next message; None if none has come by `until` [s, monotonic]. Raises HardwareFault where it closed."""
        while not self._heard:
            if self._protocol.state is not State.OPEN:
                raise HardwareFault(f"{self.address}: closed the connection")
            if not self._read(until):
                return None
        return self._heard.popleft()

    def close(self) -> None:
        """Close the connection; may be called again."""
        if self._guardian is not None:
            self._guardian.stop()  # it has the connection open too
            self._guardian = None
        if self._socket.fileno() < 0:
            return
        with suppress(HardwareFault):
            if self._protocol.state is State.OPEN:
                self._protocol.send_close()
                self._write(b"".join(self._protocol.data_to_send()))
        self._socket.close()

    def _shake_hands(self, until: float) -> None:
        self._protocol.send_request(self._protocol.connect())
        self._write(b"".join(self._protocol.data_to_send()))
        while self._protocol.state is State.CONNECTING:
            if self._protocol.handshake_exc is not None:
                raise HardwareFault(f"{self.address}: answers, but not as a WebSocket")
            if not self._read(until):
                raise HardwareFault(f"{self.address}: accepts the connection, but does not answer")

    def _read(self, until: float) -> bool:
        """Take what has come; False if nothing has by `until`."""
        try:
            ready, _, _ = select((self._socket,), (), (), max(0.0, until - monotonic()))
            if not ready:
                return False
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return True
        except (OSError, ValueError):
            data = b""
        if not data:
            raise HardwareFault(f"{self.address}: closed the connection")
        self._protocol.receive_data(data)
        for event in self._protocol.events_received():
            if isinstance(event, Frame) and event.opcode in DATA:
                self._parts.append(bytes(event.data))
                if event.fin:
                    self._heard.append(b"".join(self._parts))
                    self._parts.clear()
        if answer := b"".join(self._protocol.data_to_send()):  # to a ping, or to a close
            self._write(answer)
        return True

    def _write(self, data: bytes) -> None:
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError:
            raise HardwareFault(f"{self.address}: closed the connection") from None
        if sent < len(data):  # the guardian may write next, and the rest would corrupt the stream behind it
            raise HardwareFault(f"{self.address}: takes no more data")


def _reason(error: OSError) -> str:
    if isinstance(error, TimeoutError):
        return "does not answer"
    if error.errno == errno.ECONNREFUSED:
        return "nothing listens there"
    return os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)

"""Network namespaces for tests: commands, sockets and settings in them; skips by name where there are none."""

import os
import shutil
import signal
import socket
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ctypes import CDLL, get_errno
from functools import cache
from importlib.util import find_spec
from itertools import count
from pathlib import Path

import pytest

SERVER = "203.0.113.1"
SERVER_NAME = "relay.example"  # the public server, and its name in every namespace


CLONE_NEWNET = 0x40000000
# Connection tracking and NAT may be missing from the kernel.
_PROBE = b"table ip try { chain leaving { type nat hook postrouting priority srcnat; ct state new masquerade; }; }"


@cache
def missing() -> str:
    """What this machine lacks for the test bed, or ""."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    for program, package in (("ip", "iproute2"), ("nft", "nftables"), ("turnserver", "coturn")):
        if shutil.which(program) is None:
            return f"{program} is not installed (package {package})"
    if find_spec("wormhole_mailbox_server") is None:
        return "magic-wormhole-mailbox-server is not installed"
    name = f"wl{os.getpid()}try"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False)
    if made.returncode == 0:
        made = subprocess.run(
            ["ip", "netns", "exec", name, "nft", "-f", "-"], input=_PROBE, capture_output=True, check=False
        )
        subprocess.run(["ip", "netns", "delete", name], check=True)
    return f"network namespaces do not work here: {made.stderr.decode().strip()}" if made.returncode else ""


needs_testbed = pytest.mark.skipif(bool(missing()), reason=missing() or "the test bed works")


class Namespace:
    """A network namespace, named after this process; `role` is the end of its name."""

    _numbers = count(1)

    def __init__(self, role: str) -> None:
        self.name = f"wl{os.getpid()}.{next(self._numbers)}{role}"
        self._etc = Path("/etc/netns") / self.name
        run("ip", "netns", "add", self.name)
        self._etc.mkdir(parents=True)
        (self._etc / "hosts").write_text(f"127.0.0.1 localhost\n{SERVER} {SERVER_NAME}\n")
        self.ip("link set lo up")

    @property
    def prefix(self) -> tuple[str, ...]:
        return ("ip", "netns", "exec", self.name)

    def ip(self, *lines: str) -> None:
        """Run lines of `ip`, such as "link set lo up"."""
        run("ip", "-n", self.name, "-batch", "-", stdin="\n".join(lines))

    def nft(self, rules: str) -> None:
        run(*self.prefix, "nft", "-f", "-", stdin=rules)

    @contextmanager
    def entered(self) -> Iterator[None]:
        """This thread is here until the block ends; sockets that it makes stay here."""
        libc = CDLL(None, use_errno=True)
        with Path("/proc/thread-self/ns/net").open() as before, Path(f"/run/netns/{self.name}").open() as here:
            _enter(libc, here.fileno())
            try:
                yield
            finally:
                _enter(libc, before.fileno())

    def set_sysctl(self, name: str, value: float) -> None:
        """Set a value below /proc/sys/net, such as "ipv4/ip_forward"."""
        with self.entered():
            Path("/proc/sys/net", name).write_text(str(value))

    def forget_connections(self) -> None:
        """Empty the table of connection tracking: every mapping of a NAT is lost."""
        # A request to delete (2), of subsystem ctnetlink (1), that names no connection; flags: request, acknowledge.
        request = struct.pack("=IHHIIBBH", 20, 1 << 8 | 2, 1 | 4, 1, 0, socket.AF_INET, 0, 0)
        with self.entered(), socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 12) as control:
            control.send(request)
            _, _, _, _, error = struct.unpack_from("=IHHIIi", control.recv(4096))[1:]
        if error:
            raise OSError(-error, "connections cannot be deleted")

    def delete(self) -> None:
        listed = subprocess.run(["ip", "netns", "pids", self.name], capture_output=True, text=True, check=False)
        for process in listed.stdout.split():
            with suppress(ProcessLookupError):
                os.kill(int(process), signal.SIGKILL)
        subprocess.run(["ip", "netns", "delete", self.name], check=False)
        shutil.rmtree(self._etc, ignore_errors=True)
        with suppress(OSError):
            self._etc.parent.rmdir()


def run(*words: str, stdin: str = "") -> str:
    """Run a command; return its output. Raises a RuntimeError with what it said if it fails."""
    done = subprocess.run(words, input=stdin, capture_output=True, text=True, check=False, timeout=60)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip()}\n{stdin}")
    return done.stdout


def _enter(libc: CDLL, descriptor: int) -> None:
    if libc.setns(descriptor, CLONE_NEWNET):
        raise OSError(get_errno(), os.strerror(get_errno()))
